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

from sidm.lazy import public

#: Module -> its public names.
_MODULES = {
    "ownrobot.recordings.reading": "read_drives",
    "ownrobot.fitting.fit": "fit",
    "ownrobot.comparison.run": "compare",
    "ownrobot.fitting.model": "load Model",
}
__all__, __getattr__, __dir__ = public(__name__, _MODULES)
