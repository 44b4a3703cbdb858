"""Packages that import a name's module when the name is first asked for: PyTorch takes seconds that not all need."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from typing import Any


def on_demand(package: str, **modules: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of a package whose names come on demand.

    Args:
        package: its name.
        modules: each of its modules, with the names that the package takes from there, as 'Trained train'.
    """
    where = {name: module for module, names in modules.items() for name in names.split()}
    made = sys.modules[package]

    def get(name: str) -> Any:
        if name not in where:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        value = getattr(importlib.import_module(f"{package}.{where[name]}"), name)
        setattr(made, name, value)
        return value

    return get, lambda: sorted({*vars(made), *where}), sorted(where)
