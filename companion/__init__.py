"""What the book measures: trials of many methods, their statistics and figures.

`companion.Results(folder).frame()` is a table with one row per trial. Importing
`companion` itself imports none of its subpackages, so it is quick.
"""

import importlib
from typing import Any

#: Public name -> the module that defines it. A module is imported when a name of it is
#: first used, because most import pandas and some PyTorch.
_MODULES = {
    "FIGURES": "grids",
    "METHODS": "methods",
    "PRESETS": "presets",
    "Dataset": "trials",
    "Failure": "engine.rows",
    "Outcome": "engine.rows",
    "Preset": "presets",
    "Results": "engine.store",
    "Row": "engine.rows",
    "StoreError": "engine.records",
    "Study": "study",
    "Trial": "trials",
    "collect_and_run": "engine.run",
    "collect_datasets": "engine.datasets",
    "grid": "grids",
    "load_preset": "presets",
    "perform": "engine.execute",
    "run": "engine.run",
    "run_trial": "engine.execute",
}
__all__ = [*_MODULES]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    module = importlib.import_module(f"{__name__}.{_MODULES[name]}")
    value = globals()[name] = getattr(module, name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})
