"""Comparisons of two sets of results, paired by seed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from companion.statistics.intervals import interval, mean_ratio, ratio_of_means
from ownrobot.comparison.statistics import Interval

POINT = ("system", "novice_minutes")
#: Column of a reference: whether its motion was simulated again on another machine.
MOTION = "again"


def paired_comparison(
    frame: pd.DataFrame,
    reference: pd.DataFrame,
    on: Sequence[str] = POINT,
    by: Sequence[str] = ("method",),
    value: str = "validation_loss",
    difference: bool = False,
    held_out: float = 0.0,
) -> pd.DataFrame:
    """Compare results with a reference, group by group, paired by seed.

    Both sides are equal in the columns `on`, and the reference has at most one result a
    seed there. With its column MOTION, it has one for each motion: the one on the same
    motion as the result is taken, if there is one, else the other. The columns `by`
    distinguish groups of `frame` further. `held_out` is as in `intervals.interval`.

    Returns:
        One row per group that has a seed in common with the reference, in the order of
        `frame`. Columns: `on` and `by`; `seeds`; `reference` and `mean`, the means of
        both sides; `lower`, the number of seeds in which `frame` has the lower value;
        `ratio`, of `mean` to `reference`, or `difference`, `mean` less `reference`;
        `low` and `high`, the ends of its 95 % interval, NaN with too few seeds.

    Raises:
        ValueError: two rows stand for the same point, as in results of two grids.
    """
    both, groups = _joined(frame, reference, on, by, value)
    rows = []
    for key, group in both.groupby(groups, sort=False):
        pairs = group[["reference", value]].to_numpy(float)
        lower = int((pairs[:, 1] < pairs[:, 0]).sum())
        if difference:
            estimate = interval(mean_difference, pairs, held_out)
        else:
            estimate = ratio_of_means(pairs, held_out)
        rows.append((*key, len(pairs), *pairs.mean(0).tolist(), lower, *estimate))
    kind = "difference" if difference else "ratio"
    names = ["seeds", "reference", "mean", "lower", kind, "low", "high"]
    return _table(rows, both[groups], names)


def pooled_comparison(
    frame: pd.DataFrame,
    reference: pd.DataFrame,
    by: Sequence[str] = ("method",),
    value: str = "validation_loss",
) -> pd.DataFrame:
    """Compare results with a reference over several sizes at once.

    The estimate is the geometric mean of the ratios, paired by seed and size. A seed
    that lacks a size of its group is left out. There is one row per `system` and `by`,
    with `sizes`, a tuple of minutes, `seeds`, `ratio`, `low` and `high`.
    """
    both, _ = _joined(frame, reference, POINT, by, value)
    groups, rows = ["system", *by], []
    for key, group in both.groupby(groups, sort=False):
        wide = group.pivot(
            index="seed", columns="novice_minutes", values=[value, "reference"]
        )
        own, other = (wide[side].dropna() for side in (value, "reference"))
        estimate = mean_ratio(own.to_numpy(float), other.to_numpy(float))
        rows.append((*key, tuple(own.columns), len(own), *estimate))
    return _table(rows, both[groups], ["sizes", "seeds", "ratio", "low", "high"])


def _table(rows: list[tuple], keys: pd.DataFrame, names: list[str]) -> pd.DataFrame:
    """A table with the columns of `keys`, and numbers in `names` if it has no rows."""
    table = pd.DataFrame(rows, columns=[*keys, *names])
    if rows:
        return table
    return table.astype({**keys.dtypes, **dict.fromkeys(names, float)})


def _joined(
    frame: pd.DataFrame,
    reference: pd.DataFrame,
    on: Sequence[str],
    by: Sequence[str],
    value: str,
) -> tuple[pd.DataFrame, list[str]]:
    """The values of both sides, one row per seed, and the columns of the groups."""
    on, groups = list(on), [*on, *(name for name in by if name not in on)]
    motion = [MOTION] if MOTION in reference else []
    for side, keys in ((reference, [*on, *motion]), (frame, groups)):
        if len(side) and side.duplicated([*keys, "seed"]).any():
            raise ValueError(
                f"two rows of the same {', '.join(keys)} and seed; take the rows of "
                "one grid at a time"
            )
    other = reference[[*on, "seed", *motion, value]]
    other = other.rename(columns={value: "reference"})
    own = frame[[*groups, "seed", value]]
    if not motion:
        return own.merge(other, on=[*on, "seed"]), groups
    own = own.assign(number=range(len(own)), own=frame.repeated.to_numpy())
    both = own.merge(other, on=[*on, "seed"])
    both = both.assign(differs=both.own != both[MOTION])
    both = both.sort_values(["number", "differs"]).drop_duplicates("number")
    return both.drop(columns=["number", "own", "differs", MOTION]), groups


def mean_difference(pairs: np.ndarray) -> float:
    """Mean of the second values less the first of pairs (S, 2)."""
    return float((pairs[:, 1] - pairs[:, 0]).mean())


def unique_results(
    frame: pd.DataFrame, system: str, methods: Sequence[str]
) -> pd.DataFrame:
    """The results of a system's methods, at most one per seed, method and size.

    Two of one point, as in an ablation, raise ValueError.
    """
    results = frame[(frame.system == system) & frame.method.isin(methods)]
    if results.duplicated(["seed", "method", "novice_minutes"]).any():
        raise ValueError(
            f"two results of {system} at one point; take the rows of one grid at a time"
        )
    return results


class Losses(NamedTuple):
    """A method's complete results on one system: S seeds, M sizes."""

    minutes: np.ndarray  # (M,) rising
    values: np.ndarray  # (S, M)
    seeds: np.ndarray  # (S,)


def complete(results: pd.DataFrame, value: str = "validation_loss") -> Losses:
    """A column of a method's results on one system as an array over seeds and sizes.

    Seeds that lack a size are left out. Two results of one point raise ValueError.
    """
    wide = results.pivot(index="seed", columns="novice_minutes", values=value)
    whole = wide.dropna()
    return Losses(
        whole.columns.to_numpy(float), whole.to_numpy(float), whole.index.to_numpy(int)
    )


def interval_texts(ends: pd.DataFrame, digits: int = 3) -> list[str]:
    """Values and the ends of their intervals (n, 3) as texts; '-' without a value."""
    return [
        "-" if np.isnan(row[0]) else Interval(*row).text(digits)
        for row in ends.itertuples(index=False)
    ]


def page_table(table: pd.DataFrame, digits: int = 3, **names: str) -> pd.DataFrame:
    """A table of comparisons for a page, value and interval in one column of text.

    `names` are headings of further columns.
    """
    value = "difference" if "difference" in table else "ratio"
    texts = interval_texts(table[[value, "low", "high"]], digits)
    page = table.drop(columns=["lower", value, "low", "high"], errors="ignore")
    headings = {
        "novice_minutes": "novice data (min)",
        value: f"{value} (95 % interval)",
    }
    return page.assign(**{value: texts}).rename(columns=headings | names)
