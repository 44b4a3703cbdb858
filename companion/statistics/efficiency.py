"""Data efficiency: how many times as much data one method needs for another's loss.

Losses are read from isotonic fits of the learning curves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

#: (at least, at most) -> how to read a ratio
BOUNDS = {
    (True, True): "?",
    (True, False): ">=",
    (False, True): "<=",
    (False, False): "=",
}


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


class Efficiency(NamedTuple):
    """Data-efficiency ratio n_novice_only(loss) / n_sidm(loss) at L losses."""

    loss: np.ndarray  # (L,)
    ratio: np.ndarray  # (L,); NaN where neither a value nor a bound is known
    bound: np.ndarray  # (L,) '=', '>=' (at least), '<=' (at most) or '?'


def efficiency(
    minutes: np.ndarray, sidm: np.ndarray, novice_only: np.ndarray, losses: np.ndarray
) -> Efficiency:
    """Data-efficiency ratio at L losses, from isotonic fits of mean curves (M,)."""
    minutes, losses = np.asarray(minutes, float), np.asarray(losses, float)
    sidm_fit, novice_fit = isotonic_fit(sidm), isotonic_fit(novice_only)
    ratios, bounds = [], []
    for loss in losses:
        data, sign = minutes_needed(minutes, sidm_fit, loss)
        novice_data, novice_sign = minutes_needed(minutes, novice_fit, loss)
        more = novice_sign == ">" or sign == "<="
        less = novice_sign == "<=" or sign == ">"
        bound = BOUNDS[more, less]
        ratios.append(np.nan if bound == "?" else novice_data / data)
        bounds.append(bound)
    return Efficiency(losses, np.array(ratios), np.array(bounds))


def efficiency_at_sizes(
    minutes: np.ndarray,
    sidm: np.ndarray,
    novice_only: np.ndarray,
    novice_only_minutes: np.ndarray | None = None,
) -> Efficiency:
    """Data-efficiency ratio at the losses of the fitted SIDM curve (M,) at its sizes.

    The divisor is the size itself, also where the fit is level and a smaller size would
    be enough. The comparison's losses (N,) are at `novice_only_minutes`.
    """
    minutes, losses = np.asarray(minutes, float), isotonic_fit(sidm)
    other = minutes if novice_only_minutes is None else novice_only_minutes
    other, curve = np.asarray(other, float), isotonic_fit(novice_only)
    needed = [minutes_needed(other, curve, loss) for loss in losses]
    ratios = np.array([data for data, _ in needed]) / minutes
    bounds = [{"=": "=", ">": ">=", "<=": "<="}[sign] for _, sign in needed]
    return Efficiency(losses, ratios, np.array(bounds))


def log_of_value(ratio: float, bound: str) -> float:
    """Logarithm of a ratio; NaN for a bound, because intervals need values."""
    return float(np.log(ratio)) if bound == "=" else float("nan")
