"""Dynamics models of your own robot, from drives that you recorded.

Read drives, compare methods, fit a model, predict with it; the command `ownrobot` does
the same. A public name is imported when it is first used.

Examples:
    >>> import ownrobot
    >>> drives = ownrobot.read_drives(
    ...     "recordings/warthog.csv.gz", "recordings/skid_steer.yaml", skip_bad=True
    ... )
    >>> model = ownrobot.fit(drives, method="least_squares")
    >>> path = model.rollout(drives[0].states[0], drives[0].actions)
    >>> path.shape == drives[0].states.shape
    True
"""

import importlib
from typing import Any

#: Public name -> its module, which is imported when the name is first used, since
#: PyTorch alone takes seconds to import.
_MODULES = {
    "read_drives": "recordings.reading",
    "fit": "fitting.fit",
    "compare": "comparison.run",
    "load": "fitting.model",
    "Model": "fitting.model",
}
__all__ = [*_MODULES]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'ownrobot' has no attribute '{name}'")
    module = importlib.import_module(f"ownrobot.{_MODULES[name]}")
    value = globals()[name] = getattr(module, name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
