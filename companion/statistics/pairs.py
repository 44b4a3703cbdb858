"""Two sides of results, seed by seed: what one loses or gains beside the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from companion.methods import COMPARED
from companion.statistics.intervals import (
    Interval,
    interval,
    mean_ratio,
    ratio_of_means,
)

POINT = ("system", "novice_minutes")


def beside(
    frame: pd.DataFrame,
    reference: pd.DataFrame,
    on: Sequence[str] = POINT,
    by: Sequence[str] = ("method",),
    value: str = "validation_loss",
    difference: bool = False,
    held_out: float = 0.0,
) -> pd.DataFrame:
    """Two sides point by point, paired by seed, in the order in which the groups come.

    Args:
        frame: results, as `Results.frame` gives them.
        reference: what they are held against; at most one a seed where the columns `on`
            agree.
        on: columns in which the two sides agree, beside the seed.
        by: further columns of `frame` that tell its groups apart.
        value: the column that is compared.
        difference: whether by the mean of differences instead of the ratio of means.
        held_out: the share of the same data that each seed judges on, where seeds only
            split them anew.

    Returns:
        A line a group that has a seed in common with the reference: `on` and `by`,
        `seeds`, `reference` and `mean`, the means of both sides, `lower`, the seeds in
        which `frame`'s is the lower, and `ratio`, of the second mean to the first, or
        `difference`, the second less the first, with the ends `low` and `high` of its
        95 % interval, NaN of too few seeds.

    Raises:
        ValueError: two rows stand for the same point, as those of two grids do.
    """
    both, groups = _joined(frame, reference, on, by, value)
    lines = []
    for key, group in both.groupby(groups, sort=False):
        pairs = group[["reference", value]].to_numpy(float)
        lower = int((pairs[:, 1] < pairs[:, 0]).sum())
        found = (
            interval(_mean_difference, pairs, held_out)
            if difference
            else ratio_of_means(pairs, held_out)
        )
        lines.append((*key, len(pairs), *pairs.mean(0).tolist(), lower, *found))
    names = [
        "seeds",
        "reference",
        "mean",
        "lower",
        "difference" if difference else "ratio",
        "low",
        "high",
    ]
    return _table(lines, both[groups], names)


def together(
    frame: pd.DataFrame,
    reference: pd.DataFrame,
    by: Sequence[str] = ("method",),
    value: str = "validation_loss",
) -> pd.DataFrame:
    """Two sides over several sizes at once: the geometric mean of their ratios, paired by seed and size.

    Args:
        frame: as of `beside`, as are `reference`, `by` and `value`; a seed that lacks a
            size that another seed of the group has is left out.
        reference: the other side.
        by: further columns of `frame` that tell its groups apart.
        value: the column that is compared.

    Returns:
        A line a `system` and `by`: `sizes` that they have, `seeds`, `ratio`, `low` and
        `high`.
    """
    both, _ = _joined(frame, reference, POINT, by, value)
    groups, lines = ["system", *by], []
    for key, group in both.groupby(groups, sort=False):
        wide = group.pivot(
            index="seed", columns="novice_minutes", values=[value, "reference"]
        )
        own, other = (wide[side].dropna() for side in (value, "reference"))
        found = mean_ratio(own.to_numpy(float), other.to_numpy(float))
        lines.append((*key, tuple(own.columns), len(own), *found))
    return _table(lines, both[groups], ["sizes", "seeds", "ratio", "low", "high"])


def _table(lines: list[tuple], keys: pd.DataFrame, names: list[str]) -> pd.DataFrame:
    """Lines as a table whose columns have the types of the `keys` and of numbers, also without a line."""
    found = pd.DataFrame(lines, columns=[*keys, *names])
    return (
        found if lines else found.astype({**keys.dtypes, **dict.fromkeys(names, float)})
    )


def _joined(
    frame: pd.DataFrame,
    reference: pd.DataFrame,
    on: Sequence[str],
    by: Sequence[str],
    value: str,
) -> tuple[pd.DataFrame, list[str]]:
    """Both sides' values in one line a seed, and the columns that tell the groups apart."""
    on, groups = list(on), [*on, *(name for name in by if name not in on)]
    for side, keys in ((reference, on), (frame, groups)):
        if len(side) and side.duplicated([*keys, "seed"]).any():
            raise ValueError(
                f"two rows of the same {', '.join(keys)} and seed; take the rows of one grid at a time"
            )
    other = reference[[*on, "seed", value]].rename(columns={value: "reference"})
    return frame[[*groups, "seed", value]].merge(other, on=[*on, "seed"]), groups


def _mean_difference(pairs: np.ndarray) -> float:
    """Of the second of pairs (S, 2) less the first."""
    return float((pairs[:, 1] - pairs[:, 0]).mean())


def of_one_grid(
    frame: pd.DataFrame, system: str, methods: Sequence[str]
) -> pd.DataFrame:
    """The results of a system's methods, at most one a point.

    Raises:
        ValueError: two results stand for the same point, as those of an ablation do.
    """
    mine = frame[(frame.system == system) & frame.method.isin(methods)]
    if mine.duplicated(["seed", "method", "novice_minutes"]).any():
        raise ValueError(
            f"two results of {system} at one point; take the rows of one grid at a time"
        )
    return mine


class Losses(NamedTuple):
    """The part of some results that is complete: S seeds, K methods, M sizes."""

    minutes: np.ndarray  # (M,) rising
    values: np.ndarray  # (S, K, M)
    seeds: np.ndarray  # (S,)


def complete(
    frame: pd.DataFrame,
    system: str,
    methods: Sequence[str] = COMPARED,
    value: str = "validation_loss",
) -> Losses:
    """A column of results of a system as an array over seeds, methods and sizes.

    Sizes that a method lacks altogether are left out, then seeds that lack one of the
    sizes. Raises as `of_one_grid`.
    """
    mine = of_one_grid(frame, system, methods)
    wide = mine.pivot(index="seed", columns=["method", "novice_minutes"], values=value)
    have = [set(wide.get(method, wide[:0]).columns) for method in methods]
    sizes = sorted(set.intersection(*have)) if len(wide.columns) else []
    whole = wide.reindex(
        columns=[(method, size) for method in methods for size in sizes]
    ).dropna()
    values = whole.to_numpy(float).reshape(
        len(whole) if sizes else 0, len(methods), len(sizes)
    )
    return Losses(
        np.array(sizes, float), values, whole.index.to_numpy(int)[: len(values)]
    )


def written(table: pd.DataFrame, digits: int = 3, **names: str) -> pd.DataFrame:
    """A table of `beside` or `together` for a page: value and interval in one column of text, others by new `names`."""
    value = "difference" if "difference" in table else "ratio"
    words = [
        Interval(*line).words(digits)
        for line in table[[value, "low", "high"]].itertuples(index=False)
    ]
    found = table.drop(columns=["lower", value, "low", "high"], errors="ignore").assign(
        **{value: words}
    )
    return found.rename(
        columns={
            "novice_minutes": "novice data (min)",
            value: f"{value} [95 % interval]",
        }
        | names
    )
