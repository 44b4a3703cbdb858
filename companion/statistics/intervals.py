"""Intervals over whole seeds.

Losses are arrays whose first axis is the seed: S seeds, M sizes, L losses. A seed pairs
the methods and the sizes, so resampling draws whole seeds and keeps these pairs.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ownrobot.comparison.statistics import CONFIDENCE, Interval

RESAMPLES = 2000
#: For a verdict. The interval of two seeds reaches 13 standard errors to either side.
FEWEST_SEEDS = 3
MANY_SEEDS = 20  # from this number on, seeds are resampled

Statistic = Callable[[np.ndarray], float]


def bootstrap(
    statistic: Statistic, samples: np.ndarray, resamples: int = RESAMPLES
) -> Interval:
    """Percentile bootstrap of `statistic` over the whole seeds of `samples` (S, ...).

    The draws are always the same; the order of the seeds must not count. The interval
    of one seed is the value itself. It is NaN where the statistic of the samples or of
    a draw is not finite: without these draws it would be too narrow.
    """
    samples = np.asarray(samples, float)
    count, rng = len(samples), np.random.default_rng(0)
    draws = np.sort(rng.integers(count, size=(resamples, count)), axis=1)
    # the statistic is computed once for draws with the same seeds
    different, times = np.unique(draws, axis=0, return_counts=True)
    value = float(statistic(samples))
    values = np.repeat([statistic(samples[draw]) for draw in different], times)
    if not (np.isfinite(value) and np.isfinite(values).all()):
        return Interval(value, np.nan, np.nan)
    low, high = np.percentile(values, [50 * (1 - CONFIDENCE), 50 * (1 + CONFIDENCE)])
    return Interval(value, float(low), float(high))


def leave_one_out(statistic: Statistic, samples: np.ndarray) -> Interval:
    """Student's interval over seeds (S, ...), with the jackknife's standard error.

    With few seeds, intervals of resampled seeds are too narrow (module `coverage`);
    this one holds what it claims where the distribution of `statistic` is about
    symmetric: use the logarithm of a ratio. It is NaN with one seed, or if there is no
    value without one of the seeds.
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


def p_values(ratios: ArrayLike, seeds: ArrayLike) -> np.ndarray:
    """P-values (n,) of the hypothesis that a ratio is 1, from its interval over seeds.

    Student's two-sided test of the mean logarithm, whose 95 % interval the ratio, a
    geometric mean, has. NaN without an interval. `ratios` (n, 3) are values with the
    lower and upper ends.
    """
    from scipy.special import stdtr, stdtrit  # late: lists of results do without it

    value, low, high = np.log(np.asarray(ratios, float)).T
    free = np.asarray(seeds, float) - 1
    reach = stdtrit(free, 0.5 + CONFIDENCE / 2)
    return 2 * stdtr(free, -2 * reach * np.abs(value) / (high - low))


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

    Seeds that only split the same few data differently are not independent: each is
    tested on the same share `held_out`, drawn at random. The interval is then widened
    as in the corrected resampled t-test (Nadeau and Bengio, Machine Learning 52, 2003):
    its variance is that of the seeds times (1 / S + held_out / (1 - held_out)) instead
    of 1 / S. With fewer than FEWEST_SEEDS the interval is NaN.
    """
    if len(samples) < FEWEST_SEEDS:
        return Interval(float(statistic(np.asarray(samples, float))), np.nan, np.nan)
    method = leave_one_out if len(samples) < MANY_SEEDS else bootstrap
    value, low, high = method(statistic, samples)
    wider = np.sqrt(1 + len(samples) * held_out / (1 - held_out))
    low, high = value + wider * (low - value), value + wider * (high - value)
    return Interval(value, low, high)


def ratio_of_means(pairs: np.ndarray, held_out: float = 0.0) -> Interval:
    """Ratio of the mean of the second losses to that of the first, of pairs (S, 2)."""

    def log_ratio(drawn: np.ndarray) -> float:
        first, second = drawn.mean(0)
        return float(np.log(second / first))

    return Interval(*np.exp(interval(log_ratio, pairs, held_out)))


def mean_ratio(own: np.ndarray, other: np.ndarray) -> Interval:
    """Geometric mean of ratios of paired values (S, M), with an interval over seeds."""
    logs = np.log(own) - np.log(other)
    return Interval(*np.exp(interval(lambda drawn: float(drawn.mean()), logs)))
