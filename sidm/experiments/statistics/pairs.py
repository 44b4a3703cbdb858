"""Two sides of results, seed by seed: what one loses or gains beside the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from sidm.experiments.statistics.intervals import Interval, ratio_of_means

if TYPE_CHECKING:
    import pandas as pd


def beside(
    frame: pd.DataFrame,
    reference: pd.DataFrame,
    on: Sequence[str] = ("system", "novice_minutes"),
    by: Sequence[str] = ("method",),
    value: str = "validation_loss",
) -> pd.DataFrame:
    """Ratios of means, paired by seed, in the order in which the groups come.

    Args:
        frame: results, as `Results.frame` gives them.
        reference: what they are held against; at most one a seed where the columns `on` agree.
        on: columns in which the two sides agree, beside the seed.
        by: further columns of `frame` that tell its groups apart.
        value: the column that is compared.

    Returns:
        A line a group that has a seed in common with the reference: `on` and `by`, `seeds`, `reference` and `mean`, the
        means of both sides, `lower`, the seeds in which `frame`'s is the lower, and `ratio`, of the second mean to the
        first, with the ends `low` and `high` of its 95 % interval, NaN of too few seeds.

    Raises:
        ValueError: two rows stand for the same point, as those of two grids do.
    """
    import pandas as pd

    on, groups = list(on), [*on, *(name for name in by if name not in on)]
    for side, keys in ((reference, on), (frame, groups)):
        if len(side) and side.duplicated([*keys, "seed"]).any():
            raise ValueError(f"two rows of the same {', '.join(keys)} and seed; take the rows of one grid at a time")
    other = reference[[*on, "seed", value]].rename(columns={value: "reference"})
    both = frame[[*groups, "seed", value]].merge(other, on=[*on, "seed"])
    lines = []
    for key, group in both.groupby(groups, sort=False):
        pairs = group[["reference", value]].to_numpy()
        lower = int((pairs[:, 1] < pairs[:, 0]).sum())
        lines.append((*key, len(pairs), *pairs.mean(0).tolist(), lower, *ratio_of_means(pairs)))
    return pd.DataFrame(lines, columns=[*groups, "seeds", "reference", "mean", "lower", "ratio", "low", "high"])


def written(table: pd.DataFrame, digits: int = 3, **names: str) -> pd.DataFrame:
    """A table of `beside` for a page: the ratio and its interval in one column of text, columns by other `names`."""
    ratios = [Interval(*line).words(digits) for line in table[["ratio", "low", "high"]].itertuples(index=False)]
    found = table.drop(columns=["lower", "ratio", "low", "high"]).assign(ratio=ratios)
    return found.rename(columns={"novice_minutes": "novice data (min)"} | {"ratio": "ratio [95 % interval]"} | names)
