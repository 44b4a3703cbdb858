"""A step of Adam for the stacked weights of M trials."""

from __future__ import annotations

import math

import triton
import triton.language as tl
from torch import Tensor

ELEMENTS = 1024  # weights that one program updates


@triton.jit
def _adam(
    weights,
    gradient,
    average,
    square_average,
    active,
    rates,
    decays,
    taken,
    size,
    share1,
    share2,
    log_beta1,
    log_beta2,
    epsilon,
    DECOUPLED: tl.constexpr,
    BLOCK: tl.constexpr,
):
    """A step of Adam for a part of one trial's weights."""
    trial = tl.program_id(0).to(tl.int64)
    if tl.load(active + trial):
        index = tl.program_id(1) * BLOCK + tl.arange(0, BLOCK)
        inside = index < size
        at = trial * size + index
        rate, decay = tl.load(rates + trial), tl.load(decays + trial)
        count = tl.load(taken + trial)
        w = tl.load(weights + at, mask=inside)
        slope = tl.load(gradient + at, mask=inside)
        if DECOUPLED:
            w *= 1 - rate * decay
        else:
            slope += decay * w
        m = tl.load(average + at, mask=inside)
        v = tl.load(square_average + at, mask=inside)
        m += share1 * (slope - m)
        v += share2 * (slope * slope - v)
        correction1 = _correction(count, log_beta1)
        correction2 = _correction(count, log_beta2)
        w -= rate / correction1 * m / (tl.sqrt(v / correction2) + epsilon)
        tl.store(weights + at, w, mask=inside)
        tl.store(average + at, m, mask=inside)
        tl.store(square_average + at, v, mask=inside)


@triton.jit
def _correction(count, log_beta):
    """1 - beta^count, without the cancellation of a plain difference."""
    x = count * log_beta  # below 0
    series = -x * (1 + x / 2 * (1 + x / 3 * (1 + x / 4 * (1 + x / 5))))
    return tl.where(x > -0.1, series, 1 - tl.exp(x))


def adam_step(
    weights: Tensor,
    gradient: Tensor,
    state: tuple[Tensor, Tensor, Tensor],
    active: Tensor,
    settings: tuple[Tensor, Tensor],
    constants: tuple[float, float, float],
    decoupled: bool,
) -> None:
    """A step of Adam, in place, for the active trials.

    Args:
        weights: (M, ...), contiguous.
        gradient: (M, ...), contiguous, anything for trials that are not active.
        state: steps taken (M,), this one included, then moving averages of the gradient
            and of its square (M, ...), contiguous.
        active: (M,) bool.
        settings: learning rates (M,) and weight decays (M,).
        constants: weights of the past in both averages, and what is added to the
            denominator.
        decoupled: whether weight decay acts on the weights directly.
    """
    size = weights[0].numel()
    taken, average, square_average = state
    first, second, epsilon = constants
    grid = len(weights), triton.cdiv(size, ELEMENTS)
    _adam[grid](
        weights, gradient, average, square_average, active, *settings, taken, size,
        1 - first, 1 - second, math.log(first), math.log(second), epsilon, decoupled,
        ELEMENTS,
    )  # fmt: skip
