"""Means over pairs of robots and seeds, with Student's intervals and tests.

The robots stay the same; what varies is which drives a seed draws. A pair of robots and
a seed give one value, the mean over their sizes, which share drives. Each pair has a
variance of its own (Satterthwaite, Biometrics 2, 1946). Seeds only divide the drives of
recorded robots anew, which adds to the variance (Nadeau and Bengio, Machine Learning
52, 2003).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from companion.tasks.catalogue import HELD_OUT, RECORDED_PAIRS
from ownrobot.comparison.statistics import CONFIDENCE, Interval

RECORDED = {f"{expert} to {novice}" for novice, expert in RECORDED_PAIRS}
#: Variance that dividing the same drives anew adds, in variances of one seed's value.
DIVIDED_ANEW = HELD_OUT / (1 - HELD_OUT)


class Mean(NamedTuple):
    """A mean of logarithms.

    Attributes:
        value: the mean; NaN without values
        error: its standard error; NaN if a pair of robots has one seed alone
        freedom: degrees of freedom of the error
    """

    value: float
    error: float
    freedom: float

    @property
    def interval(self) -> Interval:
        """The geometric mean with its 95 % interval."""
        from scipy import stats  # here, since it takes long to import

        reach = stats.t.ppf((1 + CONFIDENCE) / 2, self.freedom) * self.error
        ends = (self.value + d for d in (0.0, -reach, reach))
        return Interval(*(float(np.exp(end)) for end in ends))

    @property
    def p(self) -> float:
        """Two-sided p-value of Student's test that the mean is 0."""
        from scipy import stats

        return float(2 * stats.t.sf(abs(self.value) / self.error, self.freedom))


def mean_of(logs: pd.Series) -> Mean:
    """The mean over tasks, and how certain it is.

    Args:
        logs: logarithms by robots, task and seed, which are levels of the index; NaN
            are left out. Of a pair of robots, seeds that lack one of its tasks are not
            used.
    """
    values = logs.dropna()
    means, variances, sizes, counts = [], [], [], []
    for robots, own in values.groupby("robots"):
        tasks = own.unstack("task").dropna()
        by_seed = tasks.to_numpy().mean(1)
        means.append(by_seed.mean() if len(by_seed) else np.nan)
        spread = by_seed.var(ddof=1) if len(by_seed) > 1 else np.nan
        shared = DIVIDED_ANEW if robots in RECORDED else 0.0
        variances.append(spread * (1 / max(len(by_seed), 1) + shared))
        sizes.append(tasks.shape[1])
        counts.append(len(by_seed))
    if not means:
        return Mean(np.nan, np.nan, np.nan)
    weights, free = np.array(sizes) / sum(sizes), np.array(counts) - 1
    parts = weights**2 * np.array(variances)
    squares = (parts**2 / np.maximum(free, 1)).sum()
    freedom = parts.sum() ** 2 / squares if squares > 0 else float(free.sum())
    return Mean(float(weights @ np.array(means)), float(parts.sum() ** 0.5), freedom)
