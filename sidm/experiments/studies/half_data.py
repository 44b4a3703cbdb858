"""Whether a method needs at most half the novice data of others: its losses beside theirs with twice as much and more.

Where curves are flat, a ratio of data says little with few seeds: a small step of the loss is a long way along the
curve. Losses at sizes that were run can be held against each other seed by seed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from sidm.experiments.engine.store import Row
from sidm.experiments.methods import METHODS
from sidm.experiments.statistics.intervals import FEWEST_SEEDS, Interval, ratio_of_means
from sidm.experiments.statistics.savings import ratio_words, rivals
from sidm.experiments.statistics.tables import validation_loss

AGAINST = ("sidm", "pretrain_finetune")  # the paper's method and its strongest neighbour
HALF = 2.0  # times the data that the others have at least
EQUAL = 1.0


class Half(NamedTuple):
    """A method at one size, and another at the smallest of its sizes that is so many times as large or larger."""

    system: str
    method: str
    minutes: float  # of novice data that the method has
    against: str
    beside: float  # min, that the other has
    ratio: Interval  # of the method's mean loss or error to the other's, paired by seed

    @property
    def sure(self) -> bool:
        """Whether the method is better with so much less, by the whole interval."""
        return self.ratio.high < 1


def halves(
    rows: Sequence[Row],
    system: str,
    method: str,
    against: Sequence[str] = AGAINST,
    times: float = HALF,
    value: Callable[[Row], float] = validation_loss,
) -> list[Half]:
    """A line a size of a method and other method that can be compared, with FEWEST_SEEDS seeds or more.

    Args:
        rows: at most one a system, method, size and seed.
        system: whose.
        method: that has less data.
        against: the others.
        times: how many times its data they have, or more; EQUAL for the same.
        value: what is compared.
    """
    losses: dict[tuple[str, float], dict[int, float]] = {}
    for row in rows:
        trial = row.trial
        if trial.system == system:
            losses.setdefault((trial.method, trial.novice_minutes), {})[trial.seed] = value(row)
    found = []
    for minutes in sorted(size for name, size in losses if name == method):
        for other in against:
            enough = [size for name, size in losses if name == other and size >= times * minutes]
            own, its = losses[method, minutes], losses.get((other, min(enough, default=0.0)), {})
            seeds = sorted(own.keys() & its.keys())
            if len(seeds) >= FEWEST_SEEDS:
                pairs = np.array([[its[seed], own[seed]] for seed in seeds])
                found.append(Half(system, method, minutes, other, min(enough), ratio_of_means(pairs)))
    return found


def halved_words(rows: Sequence[Row], system: str, method: str, found: Sequence[Half]) -> str:
    """What a method reaches with its least data, and at how many sizes others with twice as much do worse."""
    sides = {other: [one for one in found if (one.system, one.method, one.against) == (system, method, other)]
             for other in AGAINST}  # fmt: skip
    saved = rivals(rows, system, [method], AGAINST)
    if not saved or not all(sides.values()):
        return f"{system}: {'too few seeds' if saved else 'not run'}"
    first, labels = saved[0].saving[AGAINST[-1]], [METHODS[other].label for other in AGAINST]
    counts = (f"{sum(one.sure for one in mine)} of {len(mine)} sizes" for mine in sides.values())
    below = " and ".join(f"that of '{label}' at {count}" for label, count in zip(labels, counts, strict=True))
    return (
        f"{system}: with {first.minutes:g} min a loss of {first.loss:.3g}, for which '{labels[-1]}' needs "
        f"{ratio_words(first)} times the data; with at most half the data its loss is lower, by the whole 95 % "
        f"interval, than {below}"
    )


def by_method(found: Sequence[Half], methods: Sequence[str], points: int) -> list[tuple]:
    """A line a method: at how many of its comparisons with each other it is better, and what that says.

    Args:
        found: `halves` of the methods, all systems.
        methods: in their order; those without a line are left out.
        points: how many systems and sizes a method has to have been held against each other at.

    Returns:
        The method, '8 of 8' for each of AGAINST, and 'yes', 'no', or 'not all run'.
    """
    lines = []
    for method in methods:
        sides = [[one for one in found if (one.method, one.against) == (method, other)] for other in AGAINST]
        if any(sides):
            counts = [f"{sum(one.sure for one in side)} of {len(side)}" for side in sides]
            sure = all(one.sure for side in sides for one in side)
            whole = all(len(side) == points for side in sides)
            lines.append((method, *counts, "no" if not sure else "yes" if whole else "not all run"))
    return lines
