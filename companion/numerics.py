"""Versions of the numbers: a stored result with other versions than today's is stale.

Raise the version of a kind of work here when its numbers change. The golden tests
compare short examples of every kind with stored numbers, and fail until the version is
raised. Code that is moved, renamed or reworded changes no number and so no version.
"""

from __future__ import annotations

#: Kind of work -> version of its numbers.
RESULT_VERSIONS: dict[str, int] = {
    "simulation": 1,  # from a Collection to its trajectories
    "free_struts": 2,  # simulation of robots whose struts no motor brakes
    # from trajectories to an Outcome: maps, networks, Algorithms 1 and 2, evaluation
    "training": 1,
    "bundle": 1,  # training of many trials as one computation
    "least_squares": 1,  # weights in closed form
    "diagnosis": 1,  # comparison of two systems' latents
    "elsewhere": 1,  # trials on recorded motion
    "driving": 1,  # planning and driving
    "uncertainty": 1,  # training by likelihood
    "experts": 1,  # several experts before the novice
    "fitting": 1,  # models fitted to recorded drives of any body
    "benchmark": 1,  # tasks, and the evaluation of methods on them
    "trees": 1,  # boosted trees in the benchmark, with their settings
    "gaussian_process": 1,  # Gaussian processes there
}

_OF_TASKS = "simulation", "training", "least_squares", "fitting", "benchmark"
#: Kind of work -> the other kinds that its results depend on; others than these depend
#: on simulation and training.
_DEPENDS_ON: dict[str, tuple[str, ...]] = {
    "simulation": (),
    "free_struts": ("simulation",),
    "training": ("simulation",),
    "elsewhere": ("simulation", "training", "least_squares"),
    "driving": ("simulation", "training", "least_squares"),
    "fitting": ("training", "least_squares"),
    "benchmark": ("simulation", "training", "least_squares", "fitting"),
    "trees": _OF_TASKS,
    "gaussian_process": _OF_TASKS,
}


def versions(kind: str) -> dict[str, int]:
    """Today's versions of a kind of work and of the kinds that it depends on.

    Args:
        kind: a key of RESULT_VERSIONS.
    """
    needed = (*_DEPENDS_ON.get(kind, ("simulation", "training")), kind)
    return {name: RESULT_VERSIONS[name] for name in needed}


def version_label(kind: str) -> str:
    """The numbers of `versions` as part of a file name, such as '1.1'."""
    return ".".join(map(str, versions(kind).values()))
