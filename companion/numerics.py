"""Versions of the numbers: a stored result counts as today's while the versions that it was made with are today's.

Whoever changes what a kind of work comes to raises its version here. The golden tests
hold short examples of every kind against stored figures and fail until that is done;
moving, renaming or rewording code changes neither.
"""

from __future__ import annotations

#: Kind of work -> version of its figures.
NUMERICS: dict[str, int] = {
    "simulation": 1,  # a collection's values -> its trajectories
    "free_struts": 2,  # the same of robots whose struts no motor brakes
    # trajectories -> a trial's outcome: maps, networks, Algorithms 1 and 2, evaluation
    "training": 1,
    "bundle": 1,  # the same of many trials as one computation
    "least_squares": 1,  # weights in closed form
    "diagnosis": 1,  # how alike two systems' latents are
    "elsewhere": 1,  # trials on recorded motion
    "driving": 1,  # planning and driving
    "uncertainty": 1,  # training by likelihood
    "experts": 1,  # several experts before the novice
    "fitting": 1,  # recorded drives of any body, learnt
}

#: Kind of work -> the kinds that its results depend on besides itself.
_FROM: dict[str, tuple[str, ...]] = {
    "simulation": (),
    "free_struts": ("simulation",),
    "training": ("simulation",),
    "elsewhere": ("simulation", "training", "least_squares"),
    "driving": ("simulation", "training", "least_squares"),
    "fitting": ("training", "least_squares"),
}


def versions(kind: str) -> dict[str, int]:
    """Today's versions of all that a result of this kind of work, one of NUMERICS, depends on."""
    needed = (*_FROM.get(kind, ("simulation", "training")), kind)
    return {name: NUMERICS[name] for name in needed}


def numbered(kind: str) -> str:
    """The same for the name of a file that is kept for later: '1.1'."""
    return ".".join(map(str, versions(kind).values()))
