"""Means over the fits of a comparison, with intervals that know that folds share data.

The fits of several folds and repeats learn from the same sessions, so that their losses
are not independent. The corrected resampled t-test (Nadeau and Bengio, Machine Learning
52, 2003) adds to the variance of their mean the share of held-out to learnt data.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

CONFIDENCE = 0.95
FEWEST = 4  # fits of an interval


class Interval(NamedTuple):
    """A mean and its 95 % interval; the bounds are NaN below FEWEST values."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        if not np.isfinite(self.low):
            return f"{self.value:.3g}"
        return f"{self.value:.3g} ({self.low:.3g} to {self.high:.3g})"


def resampled_mean(values: np.ndarray, folds: int) -> Interval:
    """The mean of values (n,) from n fits, of which each holds out one of `folds`.

    Args:
        values: (n,), one for each fit.
        folds: parts of the sessions; a fit learns from all others.
    """
    from scipy import stats  # here, since it takes long to import

    count, mean = len(values), float(np.mean(values))
    if count < FEWEST:
        return Interval(mean, np.nan, np.nan)
    spread = float(np.std(values, ddof=1))
    error = spread * np.sqrt(1 / count + 1 / (folds - 1))
    width = float(stats.t.ppf((1 + CONFIDENCE) / 2, count - 1)) * error
    return Interval(mean, mean - width, mean + width)


def resampled_loss(losses: np.ndarray, folds: int) -> Interval:
    """The mean of losses (n,), with an interval above 0.

    The interval is symmetric for the loss's logarithm, to first order.
    """
    mean, low, high = resampled_mean(losses, folds)
    if not mean > 0:
        return Interval(mean, low, high)
    below, above = np.exp([low / mean - 1, high / mean - 1])
    return Interval(mean, float(mean * below), float(mean * above))


def resampled_ratio(first: np.ndarray, second: np.ndarray, folds: int) -> Interval:
    """Geometric mean of the ratios `first` / `second`, (n,) each, of paired fits."""
    logs = resampled_mean(np.log(np.asarray(first) / np.asarray(second)), folds)
    return Interval(*np.exp(logs))
