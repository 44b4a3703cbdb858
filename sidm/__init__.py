"""Dynamics models of robots that share what they learn: Wang and Johnson, L4DC 2021.

Simulate a pair of robots or read recorded drives, fit a model, ask it and keep it. Each
name below is imported when it is first used; the parts that it comes from are the
reference of the book.

Examples:
    >>> import sidm
    >>> novice = sidm.simulate(sidm.SYSTEMS["system1"], "novice", minutes=0.5, seed=0)
    >>> model = sidm.fit(novice, method="least_squares")
    >>> unseen = sidm.simulate("system1", "novice", minutes=0.2, seed=1)
    >>> path = model.rollout(unseen[0].states[0], unseen[0].actions, ground=unseen[0].ground)
    >>> path.shape
    (65, 13)
"""

import importlib
from typing import Any

__version__ = "0.2.0"

#: Public name -> the module that it is imported from when it is first asked for:
#: PyTorch alone takes seconds.
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
    "compare": "fitting.fit",
    "load": "fitting.model",
    "train": "learning.training",
}
__all__ = [*_MODULES]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'sidm' has no attribute '{name}'")
    value = globals()[name] = getattr(
        importlib.import_module(f"sidm.{_MODULES[name]}"), name
    )
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})
