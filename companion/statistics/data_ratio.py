"""Data ratio of training alone to a method, seed by seed, at one size.

The size is chosen before the results are known. A seed's ratio is read from the
isotonic fit of that seed's losses. The estimate over seeds is the geometric mean, with
Student's interval of the logarithm. Where the curve of a seed does not reach the loss,
that seed's ratio is a bound. Then the geometric mean is known to lie on one side of the
seeds' values and bounds, and no interval is known: a true ratio far beyond its bound
would raise the mean and widen the interval.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from companion.statistics.efficiency import isotonic_fit, minutes_needed
from companion.statistics.intervals import FEWEST_SEEDS, Interval, student


def data_ratio(
    sizes: Sequence[float], alone: np.ndarray, losses: np.ndarray, at: float
) -> Interval:
    """Data of training alone divided by the method's, at equal loss, paired by seed.

    Args:
        sizes: (M,) data of training alone, rising, min.
        alone: (S, M) losses of training alone.
        losses: (S,) losses of the method with `at` minutes.
        at: data of the method, min.

    Returns:
        The data ratio over seeds. With a seed's bound the value is NaN, and the ends
        are those between which the geometric mean of these seeds lies: the geometric
        mean of values and bounds, and 0 or infinity. NaN with bounds of both sides.
    """
    needed = [
        minutes_needed(np.asarray(sizes), isotonic_fit(curve), loss)
        for curve, loss in zip(alone, losses, strict=True)
    ]
    logs = np.log([minutes / at for minutes, _ in needed])
    signs = {sign for _, sign in needed}
    if len(logs) < FEWEST_SEEDS or {">", "<="} <= signs:
        return Interval(np.nan, np.nan, np.nan)
    if ">" in signs:
        return Interval(np.nan, float(np.exp(logs.mean())), np.inf)
    if "<=" in signs:
        return Interval(np.nan, 0.0, float(np.exp(logs.mean())))
    return Interval(*(float(np.exp(end)) for end in student(logs)))
