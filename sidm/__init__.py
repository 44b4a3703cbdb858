"""Dynamics models of robots that share what they learn: Wang and Johnson, L4DC 2021.

Simulate a pair of robots or read recorded drives, fit a model, use it and save it. A
public name is imported when it is first used. The book's reference describes the
modules that the names come from.

Examples:
    >>> import sidm
    >>> novice = sidm.simulate(sidm.SYSTEMS["system1"], "novice", minutes=0.5, seed=0)
    >>> model = sidm.fit(novice, method="least_squares")
    >>> drive = sidm.simulate("system1", "novice", minutes=0.2, seed=1)[0]
    >>> path = model.rollout(drive.states[0], drive.actions, ground=drive.ground)
    >>> path.shape
    (65, 13)
"""

import importlib
from typing import Any

__version__ = "0.2.0"

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
    "Model": "fitting.model",
    "Network": "settings",
    "Training": "settings",
    "simulate": "simulation.motion",
    "read_drives": "recordings.reading",
    "fit": "fitting.fit",
    "compare": "comparison.run",
    "load": "fitting.files",
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
