"""What the book measures: trials of many methods, their results, statistics, figures and studies.

`companion.Results(folder).frame()` has a row a trial. Importing `companion` itself
imports none of its rooms.
"""

import importlib
from typing import Any

#: Name -> the module that has it, imported when the name is first asked for: most bring
#: pandas, some PyTorch.
_MODULES = {
    "FIGURES": "grids",
    "METHODS": "methods",
    "PRESETS": "presets",
    "UNKNOWN": "trials",
    "Dataset": "trials",
    "Failure": "engine.store",
    "Outcome": "engine.store",
    "Preset": "presets",
    "Results": "engine.store",
    "Row": "engine.store",
    "StoreError": "engine.records",
    "Study": "study",
    "Trial": "trials",
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
    value = globals()[name] = getattr(
        importlib.import_module(f"{__name__}.{_MODULES[name]}"), name
    )
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})
