"""How much novice data a method saves, at each size and for each component of the transition."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from sidm.experiments.engine.store import Row
from sidm.experiments.statistics.efficiency import (
    Efficiency,
    efficiency,
    efficiency_at_sizes,
    falling,
    known,
    minutes_needed,
)
from sidm.experiments.statistics.intervals import Interval, interval
from sidm.experiments.statistics.tables import gather, validation_loss


class Saving(NamedTuple):
    """Data-efficiency ratio where a method has seen so much of the novice."""

    minutes: float  # of novice data that the method has
    loss: float  # that it reaches with them, along its isotonic fit
    ratio: Interval  # of the data that the comparison needs for that loss; no ends where a seed left out makes a bound
    bound: str  # of the ratio: '=', '>=' or '<='
    seeds: int = 0


def savings(
    rows: Sequence[Row],
    system: str,
    method: str = "sidm",
    against: str = "novice_only",
    value: Callable[[Row], float] = validation_loss,
) -> list[Saving]:
    """At each size of a method: how many times its data the comparison, on its own sizes, needs to do as well.

    Args:
        rows: of Figure 3, or of the variants; seeds that lack one of a method's sizes are left out.
        system: whose.
        method: that saves.
        against: the comparison.
        value: the loss that is compared.
    """
    own, other = (gather(rows, system, (name,), value) for name in (method, against))
    seeds = np.intersect1d(own.seeds, other.seeds)
    if not (seeds.size and own.minutes.size and other.minutes.size):
        return []
    sides = [side.values[np.isin(side.seeds, seeds), 0] for side in (own, other)]
    return savings_between(own.minutes, sides[0], other.minutes, sides[1])


def savings_between(
    own_minutes: np.ndarray, own: np.ndarray, other_minutes: np.ndarray, other: np.ndarray
) -> list[Saving]:
    """The same from losses: `own` (S, M) at the method's sizes (M,), `other` (S, N) at the comparison's (N,)."""
    both = np.hstack([own, other])  # (S, M + N)
    count = len(own_minutes)

    def at_sizes(some: np.ndarray) -> Efficiency:
        mean = some.mean(0)
        return efficiency_at_sizes(own_minutes, mean[:count], mean[count:], other_minutes)

    def at(size: int) -> Interval:
        def ratio(some: np.ndarray) -> float:
            again = at_sizes(some)
            return known(again.ratio[size], str(again.bound[size]))

        return Interval(float(found.ratio[size]), *np.exp(interval(ratio, both)[1:]))

    found = at_sizes(both)
    return [
        Saving(float(minutes), float(found.loss[size]), at(size), str(found.bound[size]), len(own))
        for size, minutes in enumerate(own_minutes)
    ]


def minutes_words(minutes: np.ndarray, losses: np.ndarray, loss: float) -> str:
    """With how much data a method has a loss, by its own mean losses (M,) at sizes (M,), as 'more than 20 min'."""
    much, sign = minutes_needed(minutes, falling(losses), loss)
    return {"=": "", "<=": "at most ", ">": "more than "}[sign] + f"{float(f'{much:.2g}'):g} min"


class Rival(NamedTuple):
    """A method on one system and size, and how much data two others need to do as well."""

    system: str
    method: str
    saving: dict[str, Saving]  # by the name of the other


def rivals(
    rows: Sequence[Row], system: str, methods: Sequence[str], against: Sequence[str] = ("sidm", "pretrain_finetune")
) -> list[Rival]:
    """A line a method and size, for the methods that have rows."""
    found = []
    for method in methods:
        columns = {other: savings(rows, system, method, other) for other in against}
        if all(columns.values()):
            for size in zip(*columns.values(), strict=True):
                found.append(Rival(system, method, dict(zip(columns, size, strict=True))))
    return found


def ratio_words(saving: Saving) -> str:
    """A ratio for a table: 'at least 3.2 [1.9, 5.4]', without brackets where there is no interval."""
    return {"=": "", ">=": "at least ", "<=": "at most "}[saving.bound] + str(saving.ratio)


def efficiency_band(minutes: np.ndarray, pairs: np.ndarray, losses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """95 % interval of the data-efficiency ratio at each of `losses` (L,): low and high ends, NaN where there is none.

    Args:
        minutes: (M,) sizes, rising.
        pairs: (S, 2, M) losses, the method's before the comparison's.
        losses: (L,) to be reached.
    """

    def ratio(some: np.ndarray, loss: float) -> float:
        method, comparison = some.mean(0)
        again = efficiency(minutes, method, comparison, np.array([loss]))
        return known(again.ratio[0], str(again.bound[0]))

    found = np.exp([interval(lambda some, loss=loss: ratio(some, loss), pairs) for loss in losses])  # type: ignore
    return found[:, 1], found[:, 2]
