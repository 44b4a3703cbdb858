"""How many times as much data one method needs for the loss of another, along isotonic fits of their curves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


def falling(losses: np.ndarray) -> np.ndarray:
    """Isotonic fit of the log of losses (M,), in order of growing data: the nearest curve that never rises."""
    from scipy.optimize import isotonic_regression

    return np.exp(
        isotonic_regression(np.log(np.asarray(losses, float)), increasing=False).x
    )


def minutes_needed(
    minutes: np.ndarray, curve: np.ndarray, loss: float
) -> tuple[float, str]:
    """Novice data with which a falling curve (M,) over `minutes` (M,) gets down to `loss`.

    Returns:
        The minutes, interpolated between the logarithms, and how they are to be read:
        '=', '<=' where the smallest size is already there, '>' where the largest is not
        yet.
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


def efficiency(
    minutes: np.ndarray, sidm: np.ndarray, novice_only: np.ndarray, losses: np.ndarray
) -> Efficiency:
    """How many times as much data the comparison needs, along the isotonic fits of two curves of mean losses (M,)."""
    curves = falling(sidm), falling(novice_only)
    ratios, bounds = [], []
    for loss in np.asarray(losses, float):
        (own, own_sign), (other, other_sign) = (
            minutes_needed(np.asarray(minutes, float), c, loss) for c in curves
        )
        more, less = (
            other_sign == ">" or own_sign == "<=",
            other_sign == "<=" or own_sign == ">",
        )
        bound = "?" if more and less else ">=" if more else "<=" if less else "="
        ratios.append(np.nan if bound == "?" else other / own)
        bounds.append(bound)
    return Efficiency(np.asarray(losses, float), np.array(ratios), np.array(bounds))


def efficiency_at_sizes(
    minutes: np.ndarray,
    sidm: np.ndarray,
    novice_only: np.ndarray,
    novice_only_minutes: np.ndarray | None = None,
) -> Efficiency:
    """How many times as much data the comparison needs for what the fitted SIDM curve (M,) has at each size.

    The size itself is the divisor, also where the fit is level and a smaller one would
    do. The comparison's curve has the same sizes unless its own (N,) are given.
    """
    minutes, losses, other = (
        np.asarray(minutes, float),
        falling(sidm),
        falling(novice_only),
    )
    known_at = (
        minutes
        if novice_only_minutes is None
        else np.asarray(novice_only_minutes, float)
    )
    needed = [minutes_needed(known_at, other, loss) for loss in losses]
    ratios = np.array([much for much, _ in needed]) / minutes
    return Efficiency(
        losses,
        ratios,
        np.array([{"=": "=", ">": ">=", "<=": "<="}[sign] for _, sign in needed]),
    )


def known(ratio: float, bound: str) -> float:
    """Logarithm of a ratio, NaN where it is only a bound: intervals are of values, not of bounds."""
    return float(np.log(ratio)) if bound == "=" else float("nan")
