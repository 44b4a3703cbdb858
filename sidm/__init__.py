"""Dynamics models of robots that share what they learn: Wang and Johnson, L4DC 2021.

The paper's pairs of robots, their simulation, its networks and its training. A public
name is imported when it is first used. The book's reference describes the modules that
the names come from.

Examples:
    >>> import sidm
    >>> drives = sidm.simulate("system1", "novice", minutes=0.2, seed=0)
    >>> drives[0].states.shape
    (65, 13)
"""

import importlib
from typing import Any

__version__ = "0.3.0"

#: Public name -> its module, which is imported when the name is first used, since
#: PyTorch alone takes seconds to import.
_MODULES = {
    "SYSTEMS": "systems",
    "System": "systems",
    "Robot": "systems",
    "Terrain": "systems",
    "Body": "body",
    "Drive": "drives",
    "Ground": "drives",
    "Network": "settings",
    "Training": "settings",
    "simulate": "simulation.motion",
    "train": "learning.training",
}
__all__ = [*_MODULES]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'sidm' has no attribute '{name}'")
    module = importlib.import_module(f"sidm.{_MODULES[name]}")
    value = globals()[name] = getattr(module, name)
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
