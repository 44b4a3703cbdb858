"""Packages whose public names are imported when they are first used.

PyTorch alone takes seconds to import, and most uses of a package need little of it.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any


def public(
    package: str, modules: Mapping[str, str]
) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """`__all__`, `__getattr__` and `__dir__` of a package.

    Args:
        package: its `__name__`.
        modules: a module's name -> the public names that it defines, in one text.
    """
    homes = {name: home for home, names in modules.items() for name in names.split()}
    whole = importlib.import_module(package)

    def find(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        value = getattr(importlib.import_module(homes[name]), name)
        setattr(whole, name, value)
        return value

    return [*homes], find, lambda: sorted({*vars(whole), *homes})
