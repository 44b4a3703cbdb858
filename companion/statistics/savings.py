"""How much novice data a method saves, at each of its sizes."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
import pandas as pd

from companion.statistics.efficiency import (
    Efficiency,
    efficiency,
    efficiency_at_sizes,
    falling,
    known,
    minutes_needed,
)
from companion.statistics.intervals import Interval, interval
from companion.statistics.pairs import Losses, beside, complete

COLUMNS = [
    "system",
    "method",
    "against",
    "novice_minutes",
    "seeds",
    "loss",
    "ratio",
    "low",
    "high",
    "bound",
]


def savings(
    frame: pd.DataFrame,
    methods: Sequence[str] = ("sidm",),
    against: Sequence[str] = ("novice_only",),
    value: str = "validation_loss",
    held_out: float = 0.0,
) -> pd.DataFrame:
    """How many times a method's data others, on their own sizes, need to do as well as it does at each size.

    Args:
        frame: of Figure 3, or of the variants; seeds that lack one of a method's sizes
            are left out.
        methods: that save.
        against: the comparisons.
        value: the column that is compared.
        held_out: the share of the same data that each seed judges on, where seeds only
            split them anew.

    Returns:
        A line a system, method, comparison and size: `loss`, that the method reaches
        along its isotonic fit, and the `ratio` of the data that the comparison needs
        for it, with the ends of its 95 % interval, NaN where a seed left out makes a
        bound, and how the ratio is to be read: `bound` is '=', '>=' or '<='.
    """
    lines: list[tuple] = []
    for system in dict.fromkeys(frame.system):
        for method in methods:
            own = complete(frame, system, [method], value)
            for other in against:
                found = savings_between(
                    own, complete(frame, system, [other], value), held_out
                )
                lines += [(system, method, other, *line) for line in found]
    found = pd.DataFrame(lines, columns=COLUMNS)
    return found.astype(
        {
            name: float
            for name in ("novice_minutes", "seeds", "loss", "ratio", "low", "high")
        }
    )


def savings_between(own: Losses, other: Losses, held_out: float = 0.0) -> list[tuple]:
    """Data ratio between two methods, one curve each: size, seeds, loss, ratio, its ends, bound."""
    seeds, count = np.intersect1d(own.seeds, other.seeds), len(own.minutes)
    if not (seeds.size and count and len(other.minutes)):
        return []
    # (S, M + N)
    both = np.hstack(
        [side.values[np.isin(side.seeds, seeds), 0] for side in (own, other)]
    )

    def at_sizes(some: np.ndarray) -> Efficiency:
        mean = some.mean(0)
        return efficiency_at_sizes(
            own.minutes, mean[:count], mean[count:], other.minutes
        )

    def ends(size: int) -> np.ndarray:
        def ratio(some: np.ndarray) -> float:
            again = at_sizes(some)
            return known(again.ratio[size], str(again.bound[size]))

        return np.exp(interval(ratio, both, held_out)[1:])

    found = at_sizes(both)
    return [
        (
            float(minutes),
            len(seeds),
            float(found.loss[size]),
            float(found.ratio[size]),
            *ends(size).tolist(),
            str(found.bound[size]),
        )
        for size, minutes in enumerate(own.minutes)
    ]


def with_savings(
    means: pd.DataFrame,
    frame: pd.DataFrame,
    reference: pd.DataFrame,
    on: Sequence[str],
    by: Sequence[str],
) -> pd.DataFrame:
    """Means at each size with how their groups stand beside a reference, by `loss`, and what novice data they save.

    Args:
        means: a line for each of the columns `on` and `by` and each of the
            `novice_minutes`.
        frame: the groups' results, a line a seed.
        reference: those that they are held against.
        on: columns in which the two sides agree beside seed and size, the system first.
        by: further columns that tell the groups apart.

    Returns:
        The means, with `ratio`, `low` and `high` as of `pairs.beside`, and how many
        times a group's data the reference needs: `saved`, `saved_low`, `saved_high` and
        `bound`. NaN where a line has nothing to be held against.
    """
    point = [*on, *by, "novice_minutes"]
    ratios = beside(frame, reference, on=[*on, "novice_minutes"], by=by, value="loss")
    lines: list[tuple] = []
    for key, own in frame.groupby(point[:-1], sort=False):
        other = reference[(reference[list(on)] == list(key[: len(on)])).all(axis=1)]
        mine, its = (
            complete(side.assign(method="any"), str(key[0]), ["any"], "loss")
            for side in (own, other)
        )
        lines += [
            (*key, minutes, *ends)
            for minutes, _, _, *ends in savings_between(mine, its)
        ]
    saved = pd.DataFrame(
        lines, columns=[*point, "saved", "saved_low", "saved_high", "bound"]
    )
    found = means.merge(ratios[[*point, "ratio", "low", "high"]], how="left", on=point)
    return found.merge(saved.astype(means[point].dtypes), how="left", on=point)


def written(table: pd.DataFrame) -> list[str]:
    """The ratios of a table of `savings` for a page: 'at least 3.2 [1.9, 5.4]', no brackets where no interval is."""
    words = {"=": "", ">=": "at least ", "<=": "at most "}
    columns = table[["bound", "ratio", "low", "high"]]
    return [
        f"{words[bound]}{Interval(*ends)}"
        for bound, *ends in columns.itertuples(index=False)
    ]


def rivals(
    frame: pd.DataFrame, methods: Sequence[str], against: Sequence[str]
) -> pd.DataFrame:
    """`savings` of methods against several others side by side: a line a system, method and size, ratios as texts."""
    found = savings(frame, methods, against)
    point = ["system", "method", "novice_minutes"]
    wide = found.assign(times=written(found)).pivot(
        index=point, columns="against", values="times"
    )
    wide = wide.reindex(columns=list(against)).dropna()
    losses = found.groupby(point).loss.first().map("{:.3f}".format).to_frame()
    return losses.join(wide, how="right").reset_index()


def minutes_words(minutes: np.ndarray, losses: np.ndarray, loss: float) -> str:
    """With how much data a method has a loss, by its own mean losses (M,) at sizes (M,), as 'more than 20 min'."""
    much, sign = minutes_needed(minutes, falling(losses), loss)
    return {"=": "", "<=": "at most ", ">": "more than "}[
        sign
    ] + f"{float(f'{much:.2g}'):g} min"


def efficiency_band(
    minutes: np.ndarray, pairs: np.ndarray, losses: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
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

    found = np.exp([interval(functools.partial(ratio, loss=x), pairs) for x in losses])
    return found[:, 1], found[:, 2]
