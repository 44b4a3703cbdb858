"""How many times a method's data training alone needs, seed by seed, at a size that was fixed before.

A seed's ratio is read along the isotonic fit of that seed's losses. Over seeds stand
the mean of the logarithm and Student's interval. Where a seed's curve does not get
there, the ratio is a bound, and a bound has no value.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from companion.statistics.efficiency import falling, minutes_needed
from companion.statistics.intervals import FEWEST_SEEDS, student


class Saving(NamedTuple):
    """A data ratio over seeds: its interval, one end of which a bound leaves open; a bound has no value."""

    value: float
    low: float
    high: float


def data_ratio(
    sizes: Sequence[float], alone: np.ndarray, losses: np.ndarray, at: float
) -> Saving:
    """How many times the data of a method training alone needs, from losses paired by seed.

    Args:
        sizes: (M,) of training alone, rising, min.
        alone: (S, M) its losses.
        losses: (S,) the method's, with `at` minutes.
        at: the method's minutes.
    """
    found = [
        minutes_needed(np.asarray(sizes), falling(curve), loss)
        for curve, loss in zip(alone, losses, strict=True)
    ]
    logs, signs = (
        np.log([minutes / at for minutes, _ in found]),
        {sign for _, sign in found},
    )
    if len(logs) < FEWEST_SEEDS or {">", "<="} <= signs:
        return Saving(np.nan, np.nan, np.nan)
    value, low, high = np.exp(student(logs))
    if ">" in signs:
        return Saving(np.nan, float(low), np.inf)
    if "<=" in signs:
        return Saving(np.nan, 0.0, float(high))
    return Saving(float(value), float(low), float(high))
