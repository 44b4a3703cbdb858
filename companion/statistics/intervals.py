"""Intervals over whole seeds.

Losses are arrays whose first axis is the seed: S seeds, M sizes, L losses. A seed pairs
the methods and the sizes, so resampling draws whole seeds and keeps these pairs.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ownrobot.comparison.statistics import CONFIDENCE, Interval, mean_interval

RESAMPLES = 2000
#: For a verdict. The interval of two seeds reaches 13 standard errors to either side.
FEWEST_SEEDS = 3
MANY_SEEDS = 20  # from this number on, seeds are resampled

Statistic = Callable[[np.ndarray], float]


def bootstrap(
    statistic: Statistic, samples: np.ndarray, resamples: int = RESAMPLES
) -> Interval:
    """Percentile bootstrap of `statistic` over the whole seeds of `samples`.

    Args:
        statistic: takes an array like `samples` and ignores the order of the seeds;
            values that are not finite are left out of the percentiles.
        samples: (S, ...), seeds first.
        resamples: how many times S seeds are drawn with replacement; the draws are
            always the same.

    Returns:
        The statistic of `samples`, and its interval: with one seed the value itself;
        NaN if the statistic is not finite.
    """
    samples = np.asarray(samples, float)
    count, rng = len(samples), np.random.default_rng(0)
    draws = np.sort(rng.integers(count, size=(resamples, count)), axis=1)
    # the statistic is computed once for draws with the same seeds
    different, times = np.unique(draws, axis=0, return_counts=True)
    value = float(statistic(samples))
    values = np.repeat([statistic(samples[draw]) for draw in different], times)
    values = values[np.isfinite(values)]
    if not (np.isfinite(value) and len(values)):
        return Interval(value, np.nan, np.nan)
    low, high = np.percentile(values, [50 * (1 - CONFIDENCE), 50 * (1 + CONFIDENCE)])
    return Interval(value, float(low), float(high))


def leave_one_out(statistic: Statistic, samples: np.ndarray) -> Interval:
    """Student's interval with the jackknife's standard error.

    The jackknife computes `statistic` without each whole seed in turn. With few seeds,
    resampling knows too little of what other seeds would give, and its intervals are
    too narrow (module `coverage`); the interval of this function has the coverage that
    it claims. The distribution of `statistic` should be about symmetric: use the
    logarithm of a ratio.

    Args:
        statistic: as in `bootstrap`.
        samples: (S, ...), seeds first.

    Returns:
        The statistic of `samples`, and its interval; NaN with one seed, or if there is
        no value without one of the seeds.
    """
    from scipy.special import stdtrit  # late: lists of results do without it

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
    """Mean of values (S,), one a seed, with Student's interval; NaN with one seed."""
    return mean_interval(values)


def p_value(ratio: Interval, seeds: int) -> float:
    """P-value of the hypothesis that a ratio is 1, from its interval over seeds.

    Student's two-sided test of the mean logarithm, whose interval the ratio has.

    Args:
        ratio: a geometric mean with its 95 % interval.
        seeds: S, of which it is the mean.

    Returns:
        The p-value; NaN without an interval.
    """
    from scipy.special import stdtr, stdtrit  # late: lists of results do without it

    value, low, high = np.log(ratio)
    if seeds < 2 or not np.isfinite([low, high]).all():
        return float("nan")
    reach = stdtrit(seeds - 1, 0.5 + CONFIDENCE / 2)
    return float(2 * stdtr(seeds - 1, -2 * reach * abs(value) / (high - low)))


def holm(p: np.ndarray) -> np.ndarray:
    """P-values (n,) corrected for n tests by Holm's step-down procedure."""
    order, count = np.argsort(p), len(p)
    factors = count - np.arange(count)
    corrected = np.empty(count)
    corrected[order] = np.minimum(1, np.maximum.accumulate(factors * p[order]))
    return corrected


def interval(
    statistic: Statistic, samples: np.ndarray, held_out: float = 0.0
) -> Interval:
    """An interval by `leave_one_out` with few seeds, by `bootstrap` with MANY_SEEDS.

    Seeds that only split the same few data differently are not independent. The
    interval is then widened as in the corrected resampled t-test (Nadeau and Bengio,
    Machine Learning 52, 2003): its variance is that of the seeds times (1 / S +
    held_out / (1 - held_out)) instead of 1 / S.

    Args:
        statistic: as in `bootstrap`.
        samples: (S, ...), seeds first.
        held_out: share of all data, drawn at random, on which each seed is tested; 0
            for independent seeds.

    Returns:
        The statistic of `samples`, and its interval; NaN with fewer than FEWEST_SEEDS.
    """
    if len(samples) < FEWEST_SEEDS:
        return Interval(float(statistic(np.asarray(samples, float))), np.nan, np.nan)
    method = leave_one_out if len(samples) < MANY_SEEDS else bootstrap
    value, low, high = method(statistic, samples)
    wider = np.sqrt(1 + len(samples) * held_out / (1 - held_out))
    low, high = value + wider * (low - value), value + wider * (high - value)
    return Interval(value, low, high)


def ratio_of_means(pairs: np.ndarray, held_out: float = 0.0) -> Interval:
    """Ratio of the mean of the second losses to the mean of the first.

    Args:
        pairs: (S, 2) losses, paired by seed.
        held_out: as in `interval`.
    """

    def log_ratio(drawn: np.ndarray) -> float:
        first, second = drawn.mean(0)
        return float(np.log(second / first))

    return Interval(*np.exp(interval(log_ratio, pairs, held_out)))


def mean_ratio(own: np.ndarray, other: np.ndarray) -> Interval:
    """Geometric mean of the ratios of paired values, with an interval over seeds.

    Args:
        own: (S, M) values of S seeds and M sizes.
        other: (S, M) values to divide by.
    """
    logs = np.log(own) - np.log(other)
    return Interval(*np.exp(interval(lambda drawn: float(drawn.mean()), logs)))
