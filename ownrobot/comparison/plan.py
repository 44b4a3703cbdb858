"""What a comparison fits: methods, folds over sessions, shares of the data, repeats."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ownrobot.fitting.learning import Settings, refuse_method
from ownrobot.fitting.splits import Split, folds, groups_of, share_of
from sidm.body import Body
from sidm.config import ConfigError
from sidm.drives import Drive

FOLDS, REPEATS = 4, 3
SHARES = (0.25, 0.5, 1.0)  # of the sessions to learn from, for the learning curve

#: Methods that learn nothing.
TRIVIAL = ("nothing_changes", "mean")
#: Methods that are compared unless others are named, from the simplest to the most
#: complex; those that do not fit the robots are left out.
DEFAULT_METHODS = (
    *TRIVIAL,
    "differential_drive",
    "rotation_centres",
    "ackermann",
    "least_squares",
    "least_squares_corrected",
    "corrected",
    "trees",
    "trees_corrected",
    "gp",
    "novice_only",
    "pretrain_finetune",
    "core_finetune",
    "sidm",
)


class Fit(NamedTuple):
    """One fit of a comparison."""

    method: str  # a name in `ownrobot.methods.registry.METHODS`
    repeat: int  # each divides the sessions anew and has a seed of its own
    fold: int  # number of the part of the sessions that is held out
    share: float  # of the other sessions, that is learnt from


class Plan(NamedTuple):
    """Sizes of a comparison."""

    methods: tuple[str, ...]
    folds: int  # parts of the sessions, each held out once in a repeat
    repeats: int  # how often the sessions are divided anew
    shares: tuple[float, ...]  # of the sessions to learn from, rising to 1
    seed: int  # of the first repeat; the next one has the next seed

    def fits(self) -> list[Fit]:
        """All fits; the fits of one repeat and method follow each other."""
        return [
            Fit(method, repeat, fold, share)
            for repeat in range(self.repeats)
            for method in self.methods
            for share in self.shares
            for fold in range(self.folds)
        ]


class Task(NamedTuple):
    """All that the fits of a comparison need."""

    plan: Plan
    novice: list[Drive]
    expert: list[Drive] | None
    settings: Settings
    folder: Path | None  # where results are kept; None: nowhere


def plan_for(
    novice: Sequence[Drive],
    expert: Sequence[Drive] | None,
    methods: Sequence[str] = (),
    fold_count: int = FOLDS,
    repeats: int = REPEATS,
    shares: Sequence[float] = SHARES,
    seed: int = 0,
) -> Plan:
    """The plan of a comparison, checked."""
    bodies = novice[0].body, None if expert is None else expert[0].body
    for method in methods:
        refuse_method(method, *bodies)
    groups = len(np.unique(groups_of(novice)))
    if groups < 2:
        raise ConfigError(
            "a single drive leaves none to evaluate on: record another, or cut it"
        )
    if fold_count < 2:
        raise ConfigError(f"folds must be at least 2, not {fold_count}")
    if seed < 0:
        raise ConfigError(f"seed must be 0 or more, not {seed}")
    if repeats < 1:
        raise ConfigError(f"repeats must be at least 1, not {repeats}")
    shares = sorted({1.0, *shares})
    if not 0 < shares[0] or shares[-1] > 1:
        raise ConfigError(f"shares are above 0 and at most 1, not {shares}")
    chosen = methods or [m for m in DEFAULT_METHODS if _is_possible(m, *bodies)]
    if fold_count >= groups:  # there is one way to hold out each session
        fold_count, repeats = groups, 1
    return Plan(tuple(dict.fromkeys(chosen)), fold_count, repeats, tuple(shares), seed)


def _is_possible(method: str, novice: Body, expert: Body | None) -> bool:
    """Whether a method can learn these robots with what is installed."""
    try:
        refuse_method(method, novice, expert)
    except (ConfigError, ImportError):
        return False
    return True


def drives_of(plan: Plan, fit: Fit, novice: Sequence[Drive]) -> Split:
    """The drives that a fit learns from, and those that evaluate it.

    The sessions of a smaller share are among those of a larger one.
    """
    seed = plan.seed + fit.repeat
    learn, held_out = folds(novice, plan.folds, seed)[fit.fold]
    if fit.share < 1:
        learn = share_of(learn, fit.share, seed)
    return Split(learn, held_out)
