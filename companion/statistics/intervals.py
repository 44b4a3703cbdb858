"""Intervals over whole seeds.

Losses come as arrays whose first axis is the seed: S seeds, M sizes, L losses. Seeds
pair the methods and the sizes, so that resampling draws whole seeds and keeps what
belongs together.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

RESAMPLES = 2000
CONFIDENCE = 0.95
#: for a verdict; two leave an interval of 13 standard errors to either side
FEWEST_SEEDS = 3
MANY_SEEDS = 20  # from here on resampling seeds tells enough


class Interval(NamedTuple):
    """An estimate with its 95 % interval."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        """With two significant digits."""
        return self.words(2)

    def words(self, digits: int) -> str:
        """The value with so many significant digits, its ends in brackets where they are known; no powers of ten."""
        value, low, high = (
            np.format_float_positional(float(f"{number:.{digits}g}"), trim="-")
            for number in self
        )
        return (
            f"{value} [{low}, {high}]"
            if np.isfinite([self.low, self.high]).all()
            else value
        )

    def side(self, of: float) -> int:
        """1 where the whole interval lies above a value, -1 where it lies below, else 0."""
        return 1 if self.low > of else -1 if self.high < of else 0


def bootstrap(
    statistic: Callable[[np.ndarray], float],
    samples: np.ndarray,
    resamples: int = RESAMPLES,
) -> Interval:
    """Percentile bootstrap of `statistic` over the whole seeds of `samples`.

    Args:
        statistic: takes an array like `samples` and does not mind the order of the
            seeds; values that are not finite are left out of the percentiles.
        samples: (S, ...), seeds first.
        resamples: how many times S seeds are drawn with replacement; the draws are
            always the same.

    Returns:
        The statistic of `samples`, and its interval: of one seed the value itself; NaN
        if the statistic is not finite.
    """
    samples = np.asarray(samples, float)
    count = len(samples)
    draws = np.sort(
        np.random.default_rng(0).integers(count, size=(resamples, count)), axis=1
    )
    different, times = np.unique(draws, axis=0, return_counts=True)
    value, values = (
        float(statistic(samples)),
        np.repeat([statistic(samples[draw]) for draw in different], times),
    )
    values = values[np.isfinite(values)]
    if not (np.isfinite(value) and len(values)):
        return Interval(value, np.nan, np.nan)
    low, high = np.percentile(values, [50 * (1 - CONFIDENCE), 50 * (1 + CONFIDENCE)])
    return Interval(value, float(low), float(high))


def leave_one_out(
    statistic: Callable[[np.ndarray], float], samples: np.ndarray
) -> Interval:
    """Student's interval with the jackknife's standard error: `statistic` without each whole seed in turn.

    With few seeds resampling knows too little of what other seeds would give, and its
    intervals are too narrow (module `coverage`); this one keeps what it promises.
    `statistic` should vary about evenly on either side of its value: give it the
    logarithm of a ratio.

    Args:
        statistic: as in `bootstrap`.
        samples: (S, ...), seeds first.

    Returns:
        The statistic of `samples`, and its interval; NaN with one seed, or where a seed
        left out leaves no value.
    """
    from scipy.special import stdtrit  # listing results does without

    samples = np.asarray(samples, float)
    count, value = len(samples), float(statistic(samples))
    if count < 2:
        return Interval(value, np.nan, np.nan)
    others = np.array(
        [statistic(np.delete(samples, seed, axis=0)) for seed in range(count)]
    )
    error = np.sqrt((count - 1) * others.var()) if np.isfinite(others).all() else np.nan
    reach = float(stdtrit(count - 1, 0.5 + CONFIDENCE / 2) * error)
    return Interval(value, value - reach, value + reach)


def student(values: np.ndarray) -> Interval:
    """The mean of one value a seed, (S,), with Student's interval; NaN with one seed."""
    return leave_one_out(lambda some: float(some.mean()), values)


def interval(
    statistic: Callable[[np.ndarray], float], samples: np.ndarray, held_out: float = 0.0
) -> Interval:
    """`leave_one_out` of samples (S, ...) with fewer than MANY_SEEDS seeds S, else `bootstrap`; NaN of too few.

    Seeds that split the same few data again and again are not independent. Where each
    seed judges on a random share `held_out` of all data, the interval is as much wider
    as the corrected resampled t-test has it (Nadeau and Bengio, Machine Learning 52,
    2003): its variance is (1 / S + held_out / (1 - held_out)) of the seeds' in place of
    1 / S.
    """
    if len(samples) < FEWEST_SEEDS:
        return Interval(float(statistic(np.asarray(samples, float))), np.nan, np.nan)
    value, low, high = (leave_one_out if len(samples) < MANY_SEEDS else bootstrap)(
        statistic, samples
    )
    wider = np.sqrt(1 + len(samples) * held_out / (1 - held_out))
    return Interval(
        value, value + wider * (low - value), value + wider * (high - value)
    )


def ratio_of_means(pairs: np.ndarray, held_out: float = 0.0) -> Interval:
    """Mean of the second of losses (S, 2) by the mean of the first, paired by seed; `held_out` as of `interval`."""

    def log_ratio(some: np.ndarray) -> float:
        first, second = some.mean(0)
        return float(np.log(second / first))

    return Interval(*np.exp(interval(log_ratio, pairs, held_out)))


def mean_ratio(own: np.ndarray, other: np.ndarray) -> Interval:
    """Of values (S, M) by others paired with them: the geometric mean over M sizes, an interval over S seeds."""
    return Interval(
        *np.exp(interval(lambda some: float(some.mean()), np.log(own) - np.log(other)))
    )
