"""Intervals over whole seeds, and how much less data a method needs.

Losses come as arrays whose first axis is the seed: S seeds, M sizes, L losses. Seeds pair the methods and the sizes,
so that resampling draws whole seeds and keeps what belongs together.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

RESAMPLES = 2000
CONFIDENCE = 0.95
FEWEST_SEEDS = 3  # for a verdict; two leave an interval of 13 standard errors to either side
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
        value, low, high = (np.format_float_positional(float(f"{number:.{digits}g}"), trim="-") for number in self)
        return f"{value} [{low}, {high}]" if np.isfinite([self.low, self.high]).all() else value

    def side(self, of: float) -> int:
        """1 where the whole interval lies above a value, -1 where it lies below, else 0."""
        return 1 if self.low > of else -1 if self.high < of else 0


class Summary(NamedTuple):
    """What Figure 3 draws at each size, each (M,)."""

    mean: np.ndarray
    interquartile_mean: np.ndarray
    minimum: np.ndarray
    maximum: np.ndarray


def summarise(losses: np.ndarray) -> Summary:
    """Mean, interquartile mean, minimum and maximum over seeds of losses (S, M)."""
    losses = np.asarray(losses, float)
    cut = len(losses) // 4
    middle = np.partition(losses, (cut, len(losses) - cut - 1), axis=0)[cut : len(losses) - cut]
    return Summary(losses.mean(0), middle.mean(0), losses.min(0), losses.max(0))


def bootstrap(
    statistic: Callable[[np.ndarray], float],
    samples: np.ndarray,
    resamples: int = RESAMPLES,
    confidence: float = CONFIDENCE,
    seed: int = 0,
) -> Interval:
    """Percentile bootstrap of `statistic` over the whole seeds of `samples`.

    Args:
        statistic: takes an array like `samples` and does not mind the order of the seeds; values that are not finite
            are left out of the percentiles.
        samples: (S, ...), seeds first.
        resamples: how many times S seeds are drawn with replacement.
        confidence: of the interval.
        seed: of the draws.

    Returns:
        The statistic of `samples`, and its interval: of one seed the value itself; NaN if the statistic is not finite.
    """
    samples = np.asarray(samples, float)
    count = len(samples)
    draws = np.sort(np.random.default_rng(seed).integers(count, size=(resamples, count)), axis=1)
    different, times = np.unique(draws, axis=0, return_counts=True)
    value, values = float(statistic(samples)), np.repeat([statistic(samples[draw]) for draw in different], times)
    values = values[np.isfinite(values)]
    if not (np.isfinite(value) and len(values)):
        return Interval(value, np.nan, np.nan)
    low, high = np.percentile(values, [50 * (1 - confidence), 50 * (1 + confidence)])
    return Interval(value, float(low), float(high))


def leave_one_out(
    statistic: Callable[[np.ndarray], float], samples: np.ndarray, confidence: float = CONFIDENCE
) -> Interval:
    """Student's interval with the jackknife's standard error: `statistic` without each whole seed in turn.

    With few seeds resampling knows too little of what other seeds would give, and its intervals are too narrow (module
    `coverage`); this one keeps what it promises. `statistic` should vary about evenly on either side of its value: give
    it the logarithm of a ratio.

    Args:
        statistic: as in `bootstrap`.
        samples: (S, ...), seeds first.
        confidence: of the interval.

    Returns:
        The statistic of `samples`, and its interval; NaN with one seed, or where a seed left out leaves no value.
    """
    samples = np.asarray(samples, float)
    count, value = len(samples), float(statistic(samples))
    if count < 2:
        return Interval(value, np.nan, np.nan)
    others = np.array([statistic(np.delete(samples, seed, axis=0)) for seed in range(count)])
    error = np.sqrt((count - 1) * others.var()) if np.isfinite(others).all() else np.nan
    reach = float(stdtrit(count - 1, 0.5 + confidence / 2) * error)
    return Interval(value, value - reach, value + reach)


def interval(statistic: Callable[[np.ndarray], float], samples: np.ndarray) -> Interval:
    """`leave_one_out` of samples (S, ...) with fewer than MANY_SEEDS seeds S, else `bootstrap`; NaN of too few."""
    if len(samples) < FEWEST_SEEDS:
        return Interval(float(statistic(np.asarray(samples, float))), np.nan, np.nan)
    return (leave_one_out if len(samples) < MANY_SEEDS else bootstrap)(statistic, samples)


def ratio_of_means(pairs: np.ndarray) -> Interval:
    """Mean of the second of losses (S, 2) by the mean of the first, paired by seed."""

    def log_ratio(some: np.ndarray) -> float:
        first, second = some.mean(0)
        return float(np.log(second / first))

    return Interval(*np.exp(interval(log_ratio, pairs)))


def mean_ratio(own: np.ndarray, other: np.ndarray) -> Interval:
    """Of values (S, M) by others paired with them: the geometric mean over M sizes, an interval over S seeds."""
    return Interval(*np.exp(interval(lambda some: float(some.mean()), np.log(own) - np.log(other))))


def falling(losses: np.ndarray) -> np.ndarray:
    """Isotonic fit of the log of losses (M,), in order of growing data: the nearest curve that never rises."""
    from scipy.optimize import isotonic_regression

    return np.exp(isotonic_regression(np.log(np.asarray(losses, float)), increasing=False).x)


def minutes_needed(minutes: np.ndarray, curve: np.ndarray, loss: float) -> tuple[float, str]:
    """Novice data with which a falling curve (M,) over `minutes` (M,) gets down to `loss`.

    Returns:
        The minutes, interpolated between the logarithms, and how they are to be read: '=', '<=' where the smallest
        size is already there, '>' where the largest is not yet.
    """
    if curve[0] <= loss:
        return float(minutes[0]), "=" if curve[0] == loss else "<="
    if curve[-1] > loss:
        return float(minutes[-1]), ">"
    right = int(np.argmax(curve <= loss))
    across = np.log(curve[right - 1] / loss) / np.log(curve[right - 1] / curve[right])
    log_left, log_right = np.log(minutes[right - 1]), np.log(minutes[right])
    return float(np.exp(log_left + across * (log_right - log_left))), "="


class Efficiency(NamedTuple):
    """Data-efficiency ratio n_novice_only(loss) / n_sidm(loss) over losses, each (L,)."""

    loss: np.ndarray
    ratio: np.ndarray  # NaN where neither a value nor a bound is known
    bound: np.ndarray  # '=', '>=' (at least), '<=' (at most) or '?'


def efficiency(minutes: np.ndarray, sidm: np.ndarray, novice_only: np.ndarray, losses: np.ndarray) -> Efficiency:
    """How many times as much data the comparison needs, along the isotonic fits of two curves of mean losses (M,)."""
    curves = falling(sidm), falling(novice_only)
    ratios, bounds = [], []
    for loss in np.asarray(losses, float):
        (own, own_sign), (other, other_sign) = (minutes_needed(np.asarray(minutes, float), c, loss) for c in curves)
        more, less = other_sign == ">" or own_sign == "<=", other_sign == "<=" or own_sign == ">"
        bound = "?" if more and less else ">=" if more else "<=" if less else "="
        ratios.append(np.nan if bound == "?" else other / own)
        bounds.append(bound)
    return Efficiency(np.asarray(losses, float), np.array(ratios), np.array(bounds))


def efficiency_at_sizes(
    minutes: np.ndarray, sidm: np.ndarray, novice_only: np.ndarray, novice_only_minutes: np.ndarray | None = None
) -> Efficiency:
    """How many times as much data the comparison needs for what the fitted SIDM curve (M,) has at each size.

    The size itself is the divisor, also where the fit is level and a smaller one would do. The comparison's curve has
    the same sizes unless its own (N,) are given.
    """
    minutes, losses, other = np.asarray(minutes, float), falling(sidm), falling(novice_only)
    known_at = minutes if novice_only_minutes is None else np.asarray(novice_only_minutes, float)
    needed = [minutes_needed(known_at, other, loss) for loss in losses]
    ratios = np.array([much for much, _ in needed]) / minutes
    return Efficiency(losses, ratios, np.array([{"=": "=", ">": ">=", "<=": "<="}[sign] for _, sign in needed]))


def known(ratio: float, bound: str) -> float:
    """Logarithm of a ratio, NaN where it is only a bound: intervals are of values, not of bounds."""
    return float(np.log(ratio)) if bound == "=" else float("nan")


def greatest_ratio(minutes: np.ndarray, pairs: np.ndarray) -> tuple[float, str]:
    """The paper's 'up to': the greatest ratio of the mean curves over the losses that SIDM reaches at a size.

    Args:
        minutes: (M,) sizes, rising.
        pairs: (S, 2, M) losses, SIDM's before the comparison's.

    Returns:
        The ratio and '=' or, where only a lower bound is known, '>='; NaN and '?' where neither is.
    """
    found = efficiency_at_sizes(minutes, *np.asarray(pairs, float).mean(0))
    usable = [(ratio, bound) for ratio, bound in zip(found.ratio, found.bound, strict=True) if bound in ("=", ">=")]
    ratio, bound = max(usable, default=(np.nan, "?"))
    return float(ratio), str(bound)
