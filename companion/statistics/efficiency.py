"""Data efficiency: how many times as much data one method needs for another's loss.

Losses are read from isotonic fits of the learning curves: of mean curves by
`savings.savings`, of each seed's curve by `data_ratio`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from companion.statistics.intervals import FEWEST_SEEDS
from ownrobot.comparison.statistics import Interval, mean_interval, significant

NO_VALUE = "no value"  # of a ratio from too few seeds


def isotonic_fit(losses: np.ndarray) -> np.ndarray:
    """The nearest curve (M,) that never rises, fitted to the logarithm of losses (M,).

    The losses are in order of growing data.
    """
    from scipy.optimize import isotonic_regression

    logs = np.log(np.asarray(losses, float))
    return np.exp(isotonic_regression(logs, increasing=False).x)


def minutes_needed(
    minutes: np.ndarray, curve: np.ndarray, loss: float
) -> tuple[float, str]:
    """Novice data with which a falling curve (M,) of M rising sizes reaches a loss.

    The minutes are interpolated between logarithms, and come with how to read them:
    '='; '<=' if the smallest size is enough; '>' if the largest is not.
    """
    if curve[0] <= loss:
        return float(minutes[0]), "=" if curve[0] == loss else "<="
    if curve[-1] > loss:
        return float(minutes[-1]), ">"
    right = int(np.argmax(curve <= loss))
    across = np.log(curve[right - 1] / loss) / np.log(curve[right - 1] / curve[right])
    log_left, log_right = np.log(minutes[right - 1]), np.log(minutes[right])
    return float(np.exp(log_left + across * (log_right - log_left))), "="


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

    The size is chosen before the results are known. The estimate over seeds is the
    geometric mean, with Student's interval of the logarithm. Where the curve of a seed
    does not reach the loss, that seed's ratio is a bound. Then there is neither a mean
    nor an interval: a true ratio far beyond its bound would raise the one and widen the
    other. What is known is told seed by seed.

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
        value, low, high = np.exp(mean_interval(np.log(ratios))).tolist()
        return DataRatio(value, low, high, "")
    low = float(ratios.min()) if beyond.all() else 0.0 if below.all() else np.nan
    high = np.inf if beyond.all() else float(ratios.max()) if below.all() else np.nan
    return DataRatio(np.nan, low, high, _in_words(ratios, beyond, below))


def _in_words(ratios: np.ndarray, beyond: np.ndarray, below: np.ndarray) -> str:
    """What seeds say of a ratio that some of them only bound."""
    known, parts = ratios[~beyond & ~below], []
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
    words = [f"{first} in {number} of {len(ratios)} seeds"]
    return ", ".join(words + [f"{text} in {number}" for text, number in others])
