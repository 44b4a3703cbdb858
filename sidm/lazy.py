"""Packages that import a name's module when the name is first asked for: PyTorch takes seconds that not all need.

Such a package imports its names under `if TYPE_CHECKING:`, for type checkers, and lists them again for `on_demand`.
"""

from __future__ import annotations

import importlib
import sys
import types
from typing import Any


class LazyPackage(types.ModuleType):
    """A package some of whose names come on demand."""

    def __getattr__(self, name: str) -> Any:
        where = self.__dict__["_where"]
        if name not in where:
            raise AttributeError(f"module '{self.__name__}' has no attribute '{name}'")
        value = getattr(importlib.import_module(f"{self.__name__}.{where[name]}"), name)
        setattr(self, name, value)
        return value

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.__dict__["_where"]})


def on_demand(package: str, **modules: str) -> None:
    """Make a package lazy.

    Args:
        package: its name.
        modules: each of its modules, with the names that the package takes from there, as 'Trained train'.
    """
    made = sys.modules[package]
    made.__dict__["_where"] = {name: module for module, names in modules.items() for name in names.split()}
    made.__class__ = LazyPackage
