"""Means with Student's intervals, also of fits that share data.

Fits of several folds and repeats learn from the same sessions, so that their losses are
not independent. The corrected resampled t-test (Nadeau and Bengio, Machine Learning 52,
2003) adds to the variance of their mean the share of held-out to learnt data.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

CONFIDENCE = 0.95
FEWEST = 4  # fits of an interval


class Interval(NamedTuple):
    """An estimate with its 95 % interval."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return self.text(2)

    def text(self, digits: int) -> str:
        """The value, and the ends of the interval in brackets where they are known.

        They have so many significant digits, without powers of ten. Of an interval that
        includes 0, its end farther from 0 has them; the others have as many decimals.
        """
        known = bool(np.isfinite([self.low, self.high]).all())
        if known and self.low < 0 < self.high:
            decimals = _decimals(max(abs(self.low), abs(self.high)), digits)
            texts = [_decimal(number, decimals) for number in self]
        else:
            texts = [significant(number, digits) for number in self]
        return "{} ({} to {})".format(*texts) if known else texts[0]

    def side(self, value: float) -> int:
        """1 if the whole interval lies above a value, -1 if below, otherwise 0."""
        return int(self.low > value) - int(self.high < value)


def significant(number: float, digits: int) -> str:
    """A number with so many significant digits, trailing zeros included.

    There are no powers of ten: from 10 ** digits on it is a whole number.
    """
    if number == 0 or not np.isfinite(number):
        return f"{number:g}"
    return _decimal(number, _decimals(number, digits))


def _decimals(number: float, digits: int) -> int:
    """Decimals with which a number has so many significant digits."""
    rounded = abs(float(f"{number:.{digits}g}"))
    return digits - 1 - math.floor(math.log10(rounded))


def _decimal(number: float, decimals: int) -> str:
    """A number with so many decimals, and with a minus sign, not a hyphen."""
    text = f"{round(number, decimals):.{max(decimals, 0)}f}"
    return text.replace("-", "" if float(text) == 0 else "\N{MINUS SIGN}")


def mean_interval(values: np.ndarray, shared: float = 0.0) -> Interval:
    """The mean of values (n,) with Student's interval; NaN bounds with one value.

    `shared` is the variance that the data which all values share add to the mean's, in
    variances of one value; 0 for independent values.
    """
    from scipy.special import stdtrit  # here, since it takes long to import

    values = np.asarray(values, float)
    count, mean = len(values), float(values.mean())
    if count < 2:
        return Interval(mean, np.nan, np.nan)
    error = values.std(ddof=1) * np.sqrt(1 / count + shared)
    reach = float(stdtrit(count - 1, (1 + CONFIDENCE) / 2) * error)
    return Interval(mean, mean - reach, mean + reach)


def resampled_mean(values: np.ndarray, folds: int) -> Interval:
    """The mean of values (n,) from n fits, of which each holds out one of `folds`.

    With fewer than FEWEST values the bounds are NaN.
    """
    mean = mean_interval(values, 1 / (folds - 1))
    return mean if len(values) >= FEWEST else Interval(mean.value, np.nan, np.nan)


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
