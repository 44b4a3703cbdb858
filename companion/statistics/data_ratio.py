"""Data ratio of training alone to a method, seed by seed, at one size.

The size is chosen before the results are known. A seed's ratio is read from the
isotonic fit of that seed's losses. The estimate over seeds is the geometric mean, with
Student's interval of the logarithm. Where the curve of a seed does not reach the loss,
that seed's ratio is a bound. Then there is neither a mean nor an interval: a true ratio
far beyond its bound would raise the one and widen the other. What is known is told seed
by seed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from companion.statistics.efficiency import isotonic_fit, minutes_needed
from companion.statistics.intervals import FEWEST_SEEDS, student
from ownrobot.comparison.statistics import Interval, significant

NO_VALUE = "no value"  # of a ratio from too few seeds


class DataRatio(NamedTuple):
    """A data ratio over seeds, with its 95 % interval, or what seeds bound it by.

    Attributes:
        value: the geometric mean; NaN with a seed's bound
        low: end of the interval; the bound where all seeds are above it, else NaN
        high: likewise; infinity and 0 stand opposite to a bound
        bound: in words, where there is no value: 'at least 24 in 2 of 5 seeds, 0.2 to
            0.98 in 3'
    """

    value: float
    low: float
    high: float
    bound: str = NO_VALUE

    def text(self, digits: int = 3) -> str:
        """The value with its interval, or the bound."""
        known = Interval(self.value, self.low, self.high)
        return self.bound if np.isnan(self.value) else known.text(digits)


def data_ratio(
    sizes: Sequence[float], alone: np.ndarray, losses: np.ndarray, at: float
) -> DataRatio:
    """Data of training alone divided by the method's, at equal loss, paired by seed.

    Training alone has losses (S, M) at M rising `sizes`, min; the method has `losses`
    (S,) with `at` minutes.
    """
    needed = [
        minutes_needed(np.asarray(sizes), isotonic_fit(curve), loss)
        for curve, loss in zip(alone, losses, strict=True)
    ]
    if len(needed) < FEWEST_SEEDS:
        return DataRatio(np.nan, np.nan, np.nan)
    ratios = np.array([minutes / at for minutes, _ in needed])
    signs = np.array([sign for _, sign in needed])
    beyond, below = signs == ">", signs == "<="
    if not (beyond | below).any():
        value, low, high = np.exp(student(np.log(ratios))).tolist()
        return DataRatio(value, low, high, "")
    low = float(ratios.min()) if beyond.all() else 0.0 if below.all() else np.nan
    high = np.inf if beyond.all() else float(ratios.max()) if below.all() else np.nan
    return DataRatio(np.nan, low, high, _in_words(ratios, beyond, below))


def _in_words(ratios: np.ndarray, beyond: np.ndarray, below: np.ndarray) -> str:
    """What seeds say of a ratio that some of them only bound."""
    known, count = ratios[~beyond & ~below], len(ratios)
    parts = []
    if beyond.any():
        parts.append((f"at least {significant(ratios[beyond].min(), 2)}", beyond.sum()))
    if below.any():
        parts.append((f"at most {significant(ratios[below].max(), 2)}", below.sum()))
    if len(known):
        ends = [significant(end, 2) for end in (known.min(), known.max())]
        parts.append((" to ".join(dict.fromkeys(ends)), len(known)))
    if len(parts) == 1:
        return parts[0][0]
    (first, number), *others = parts
    words = [f"{first} in {number} of {count} seeds"]
    return ", ".join(words + [f"{text} in {number}" for text, number in others])
