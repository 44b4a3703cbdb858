"""How much novice data a method saves, at each size and for each component of the transition."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from sidm.experiments.engine.store import Row
from sidm.experiments.methods import COMPARED, FIGURE3
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


def expert_alone(rows: Sequence[Row], system: str) -> str:
    """What the expert's model is worth as it is, in the novice data that a training without SIDM needs for as much.

    Args:
        rows: of `expert_only`, and of `novice_only` at the sizes of Figure 3.
        system: whose.
    """
    alone, other = (
        gather([row for row in rows if row.trial.method == method], system, [method])
        for method in ("expert_only", "novice_only")
    )
    if not (alone.values.size and other.values.size):
        return f"{system}: not run"
    loss = float(alone.values.mean())
    return f"{system}: {loss:.3g}, as without SIDM on {minutes_words(other.minutes, other.values[:, 0].mean(0), loss)}"


def minutes_words(minutes: np.ndarray, losses: np.ndarray, loss: float) -> str:
    """With how much data a method has a loss, by its own mean losses (M,) at sizes (M,), as 'more than 20 min'."""
    much, sign = minutes_needed(minutes, falling(losses), loss)
    return {"=": "", "<=": "at most ", ">": "more than "}[sign] + f"{float(f'{much:.2g}'):g} min"


def expert_first(rows: Sequence[Row], system: str) -> str:
    """How learning from the expert first compares: at how many sizes its loss is the lowest, and what it saves."""
    found = {method: gather(rows, system, [method]) for method in FIGURE3}
    saved, beside = (savings(rows, system, "pretrain_finetune", other) for other in ("novice_only", "sidm"))
    if not (saved and beside) or any(not np.array_equal(one.minutes, found["sidm"].minutes) for one in found.values()):
        return "not run"
    means = {method: one.values[:, 0].mean(0) for method, one in found.items()}
    lowest = int((means["pretrain_finetune"] < np.minimum(means["sidm"], means["novice_only"])).sum())
    return (
        f"the lowest mean loss at {lowest} of {len(saved)} sizes; with {saved[0].minutes:g} min as good as "
        f"without SIDM on {ratio_words(saved[0])} times the data, and as with SIDM on {ratio_words(beside[0])} times"
    )


def no_network(rows: Sequence[Row], system: str) -> str:
    """How least squares on the novice alone compare with the paper's methods: what they save, and at how many sizes."""
    found = {method: gather(rows, system, [method]) for method in ("least_squares", *COMPARED)}
    saved = [savings(rows, system, "least_squares", method) for method in COMPARED]
    own = found["least_squares"]
    if not all(saved) or any(not np.array_equal(one.minutes, own.minutes) for one in found.values()):
        return f"{system}: not run"
    means = {method: one.values[:, 0].mean(0) for method, one in found.items()}
    lower = [int((means["least_squares"] < means[method]).sum()) for method in COMPARED]
    data = [ratio_words(one[0]) for one in saved]
    return (
        f"{system}: with {own.minutes[0]:g} min a loss of {means['least_squares'][0]:.3g}, as with SIDM on {data[0]} "
        f"and without SIDM on {data[1]} times the data; a lower mean loss than with SIDM at {lower[0]} of "
        f"{own.minutes.size} sizes, and than without at {lower[1]}"
    )


def savings_summary(found: Mapping[str, Sequence[Saving]]) -> str:
    """Where the comparison needs more data than the method, and where less, by whole intervals; by system."""
    if not any(np.isfinite(one.ratio.low) for every in found.values() for one in every):
        return "cannot be told: bounds alone, or fewer than three seeds"
    said = []
    for side, words in ((1, "more"), (-1, "less")):
        told = [
            f"{system}, {one.minutes:g} min ({one.ratio} times)"
            for system, every in found.items()
            for one in every
            if one.ratio.side(1) == side
        ]
        said += [f"needs {words} data for the same loss at {'; '.join(told)}"] if told else []
    return ", and ".join(said) or "no difference seen"


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
