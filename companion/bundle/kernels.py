"""Triton kernels of a bundle on a GPU: LSTM steps, convolutions and Adam.

PyTorch's own kernels spend most of a small batch's time between launches. M trials, B
trajectories, T steps, H hidden units; N = M B trajectories, each with its own kernels
of convolution.
"""

from __future__ import annotations

import math

import triton
import triton.language as tl
from torch import Tensor

UNITS = 32  # hidden units of one program
PIXELS = 1024  # that one program convolves
PRODUCTS = 128  # pixels at a time in the gradient of a kernel of convolution
ELEMENTS = 1024  # weights that one program of Adam updates


@triton.jit
def _forward_step(
    inputs,
    turned,
    gates,
    hidden,
    cells,
    step,
    steps,
    HIDDEN: tl.constexpr,
    BATCH: tl.constexpr,
    UNITS: tl.constexpr,
    CHUNK: tl.constexpr,
):
    """One step of an LSTM layer for UNITS hidden units of one trial."""
    trial = tl.program_id(0)
    unit = tl.program_id(1) * UNITS + tl.arange(0, UNITS)
    row = tl.arange(0, BATCH)
    before = (trial * (steps + 1) + step) * BATCH * HIDDEN
    weights = turned + trial * 4 * HIDDEN * HIDDEN + unit[None, :]
    i = tl.zeros([BATCH, CHUNK, UNITS], tl.float32)
    f = tl.zeros([BATCH, CHUNK, UNITS], tl.float32)
    g = tl.zeros([BATCH, CHUNK, UNITS], tl.float32)
    o = tl.zeros([BATCH, CHUNK, UNITS], tl.float32)
    for start in range(0, HIDDEN, CHUNK):
        k = start + tl.arange(0, CHUNK)
        h = tl.load(hidden + before + row[:, None] * HIDDEN + k[None, :])[:, :, None]
        part = weights + k[:, None] * 4 * HIDDEN
        i += h * tl.load(part)[None, :, :]
        f += h * tl.load(part + HIDDEN)[None, :, :]
        g += h * tl.load(part + 2 * HIDDEN)[None, :, :]
        o += h * tl.load(part + 3 * HIDDEN)[None, :, :]
    at = (trial * steps + step) * BATCH * 4 * HIDDEN
    at += row[:, None] * 4 * HIDDEN + unit[None, :]
    i_gate = tl.sigmoid(tl.sum(i, 1) + tl.load(inputs + at))
    f_gate = tl.sigmoid(tl.sum(f, 1) + tl.load(inputs + at + HIDDEN))
    g_gate = _tanh(tl.sum(g, 1) + tl.load(inputs + at + 2 * HIDDEN))
    o_gate = tl.sigmoid(tl.sum(o, 1) + tl.load(inputs + at + 3 * HIDDEN))
    tl.store(gates + at, i_gate)
    tl.store(gates + at + HIDDEN, f_gate)
    tl.store(gates + at + 2 * HIDDEN, g_gate)
    tl.store(gates + at + 3 * HIDDEN, o_gate)
    own = before + row[:, None] * HIDDEN + unit[None, :]
    cell = f_gate * tl.load(cells + own) + i_gate * g_gate
    after = own + BATCH * HIDDEN
    tl.store(cells + after, cell)
    tl.store(hidden + after, o_gate * _tanh(cell))


@triton.jit
def _backward_step(
    hidden_gradient,
    recurrent,
    gates,
    cells,
    gradients,
    cell_gradient,
    step,
    steps,
    HIDDEN: tl.constexpr,
    BATCH: tl.constexpr,
    UNITS: tl.constexpr,
    CHUNK: tl.constexpr,
):
    """The gradient of one step's gates for UNITS hidden units of one trial."""
    trial = tl.program_id(0)
    unit = tl.program_id(1) * UNITS + tl.arange(0, UNITS)
    row = tl.arange(0, BATCH)
    weights = recurrent + trial * 4 * HIDDEN * HIDDEN + unit[None, :]
    gates_at = (trial * (steps + 1) + step) * BATCH * 4 * HIDDEN
    later = gradients + gates_at + BATCH * 4 * HIDDEN + row[:, None] * 4 * HIDDEN
    total = tl.zeros([BATCH, CHUNK, UNITS], tl.float32)
    for start in range(0, 4 * HIDDEN, CHUNK):
        k = start + tl.arange(0, CHUNK)
        slope = tl.load(later + k[None, :])[:, :, None]
        total += slope * tl.load(weights + k[:, None] * HIDDEN)[None, :, :]
    here = (trial * steps + step) * BATCH * HIDDEN
    units = row[:, None] * HIDDEN + unit[None, :]
    output = tl.sum(total, 1) + tl.load(hidden_gradient + here + units)
    at = (trial * steps + step) * BATCH * 4 * HIDDEN
    at += row[:, None] * 4 * HIDDEN + unit[None, :]
    i = tl.load(gates + at)
    f = tl.load(gates + at + HIDDEN)
    g = tl.load(gates + at + 2 * HIDDEN)
    o = tl.load(gates + at + 3 * HIDDEN)
    before = cells + (trial * (steps + 1) + step) * BATCH * HIDDEN + units
    tanh = _tanh(tl.load(before + BATCH * HIDDEN))
    kept = cell_gradient + trial * BATCH * HIDDEN + units
    cell = tl.load(kept) + output * o * (1 - tanh * tanh)
    to = gradients + gates_at + row[:, None] * 4 * HIDDEN + unit[None, :]
    tl.store(to, cell * g * i * (1 - i))
    tl.store(to + HIDDEN, cell * tl.load(before) * f * (1 - f))
    tl.store(to + 2 * HIDDEN, cell * i * (1 - g * g))
    tl.store(to + 3 * HIDDEN, output * tanh * o * (1 - o))
    tl.store(kept, cell * f)


@triton.jit
def _tanh(x):
    return 2 * tl.sigmoid(2 * x) - 1


def lstm_forward(inputs: Tensor, recurrent: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """One LSTM layer over all steps, from zero states.

    Args:
        inputs: (M, T, B, 4 H), the gates before the recurrent product is added;
            contiguous.
        recurrent: (M, 4 H, H).

    Returns:
        Gates (M, T, B, 4 H), then hidden states and cells (M, T + 1, B, H), whose first
        step is zero.
    """
    trials, steps, batch, width = inputs.shape
    hidden = inputs.new_zeros(trials, steps + 1, batch, width // 4)
    cells, gates = hidden.clone(), inputs.new_empty(inputs.shape)
    turned = recurrent.mT.contiguous()  # (M, H, 4 H): units lie side by side
    grid = trials, width // 4 // UNITS
    for step in range(steps):
        _forward_step[grid](
            inputs, turned, gates, hidden, cells, step, steps, width // 4, batch, UNITS,
            64 // batch, num_warps=4,
        )  # fmt: skip
    return gates, hidden, cells


def lstm_backward(
    hidden_gradient: Tensor, recurrent: Tensor, gates: Tensor, cells: Tensor
) -> Tensor:
    """Gradient (M, T + 1, B, 4 H) of the inputs of `lstm_forward`.

    After the last step it is zero.

    Args:
        hidden_gradient: (M, T, B, H), contiguous.
        recurrent: (M, 4 H, H), contiguous.
        gates: (M, T, B, 4 H).
        cells: (M, T + 1, B, H).
    """
    trials, steps, batch, width = gates.shape
    gradients = gates.new_zeros(trials, steps + 1, batch, width)
    cell_gradient = gates.new_zeros(trials, batch, width // 4)
    grid = trials, width // 4 // UNITS
    for step in reversed(range(steps)):
        _backward_step[grid](
            hidden_gradient, recurrent, gates, cells, gradients, cell_gradient, step,
            steps, width // 4, batch, UNITS, 128 // batch,
            num_warps=8,
        )  # fmt: skip
    return gradients


@triton.jit
def _correlate(
    source,
    weights,
    bias,
    gate,
    out,
    count,
    steps,
    weights_of_trial,
    weights_of_output,
    weights_of_input,
    channel_stride,
    pixel_stride,
    slope,
    IN: tl.constexpr,
    OUT: tl.constexpr,
    INPUTS: tl.constexpr,
    OUTPUTS: tl.constexpr,
    PAD: tl.constexpr,
    BLOCK: tl.constexpr,
):
    """Four channels of a correlation of one trajectory's maps, PIXELS at a time.

    Without PAD it is a layer: bias and leaky rectifier follow. With it, it is the
    layer's gradient: the kernels are turned, and the rectifier before has `gate`.
    """
    block, group = tl.program_id(0), tl.program_id(1).to(tl.int64)
    first = tl.program_id(2) * 4
    index = block * BLOCK + tl.arange(0, BLOCK)
    inside = index < count
    sample = index // (OUT * OUT)
    pixel = index % (OUT * OUT)
    y = pixel // OUT - PAD
    x = pixel % OUT - PAD
    maps = source + group * steps * INPUTS * IN * IN + sample * INPUTS * IN * IN
    kernels = weights + group * weights_of_trial + first * weights_of_output
    sum0 = tl.zeros([BLOCK], tl.float32)
    sum1 = tl.zeros([BLOCK], tl.float32)
    sum2 = tl.zeros([BLOCK], tl.float32)
    sum3 = tl.zeros([BLOCK], tl.float32)
    for channel in range(INPUTS):
        for down in tl.static_range(4):
            for right in tl.static_range(4):
                row, column = y + down, x + right
                valid = inside
                if PAD:
                    valid &= (row >= 0) & (row < IN) & (column >= 0) & (column < IN)
                at = maps + channel * IN * IN + row * IN + column
                value = tl.load(at, mask=valid, other=0.0)
                tap = 4 * down + right
                kernel = kernels + channel * weights_of_input
                kernel += 15 - tap if PAD else tap
                sum0 += value * tl.load(kernel)
                sum1 += value * tl.load(kernel + weights_of_output)
                sum2 += value * tl.load(kernel + 2 * weights_of_output)
                sum3 += value * tl.load(kernel + 3 * weights_of_output)
    to = group * steps * OUTPUTS * OUT * OUT + sample * OUTPUTS * OUT * OUT
    to += pixel * pixel_stride + first * channel_stride
    if PAD:
        sum0 *= _slope(gate + to, inside, slope)
        sum1 *= _slope(gate + to + channel_stride, inside, slope)
        sum2 *= _slope(gate + to + 2 * channel_stride, inside, slope)
        sum3 *= _slope(gate + to + 3 * channel_stride, inside, slope)
    else:
        biases = bias + group * OUTPUTS + first
        sum0 = _leaky(sum0 + tl.load(biases), slope)
        sum1 = _leaky(sum1 + tl.load(biases + 1), slope)
        sum2 = _leaky(sum2 + tl.load(biases + 2), slope)
        sum3 = _leaky(sum3 + tl.load(biases + 3), slope)
    tl.store(out + to, sum0, mask=inside)
    tl.store(out + to + channel_stride, sum1, mask=inside)
    tl.store(out + to + 2 * channel_stride, sum2, mask=inside)
    tl.store(out + to + 3 * channel_stride, sum3, mask=inside)


@triton.jit
def _leaky(x, slope):
    return tl.where(x > 0, x, x * slope)


@triton.jit
def _slope(outputs, inside, slope):
    """The derivative of the leaky rectifier, from its outputs."""
    return tl.where(tl.load(outputs, mask=inside, other=0.0) > 0, 1.0, slope)


@triton.jit
def _kernel_gradient(
    source,
    gradient,
    out,
    steps,
    COUNT: tl.constexpr,
    IN: tl.constexpr,
    OUT: tl.constexpr,
    INPUTS: tl.constexpr,
    OUTPUTS: tl.constexpr,
    BLOCK: tl.constexpr,
):
    """The gradient of one trajectory's kernels, from one channel to four."""
    group = tl.program_id(0).to(tl.int64)
    channel, first = tl.program_id(1), tl.program_id(2) * 4
    tap = tl.arange(0, 16)
    shift = (tap // 4) * IN + tap % 4
    maps = source + group * steps * INPUTS * IN * IN + channel * IN * IN
    slopes = gradient + group * steps * OUTPUTS * OUT * OUT + first * OUT * OUT
    sum0 = tl.zeros([16, BLOCK], tl.float32)
    sum1 = tl.zeros([16, BLOCK], tl.float32)
    sum2 = tl.zeros([16, BLOCK], tl.float32)
    sum3 = tl.zeros([16, BLOCK], tl.float32)
    for start in range(0, COUNT, BLOCK):
        index = start + tl.arange(0, BLOCK)
        inside = index < COUNT
        sample = index // (OUT * OUT)
        pixel = index % (OUT * OUT)
        corner = sample * INPUTS * IN * IN + (pixel // OUT) * IN + pixel % OUT
        # nearly true, and makes neighbouring threads load neighbouring pixels
        corner = tl.max_contiguous(corner, BLOCK)
        value = tl.load(
            maps + corner[None, :] + shift[:, None], mask=inside[None, :], other=0.0
        )
        at = slopes + sample * OUTPUTS * OUT * OUT + pixel
        slope0 = tl.load(at, mask=inside, other=0.0)
        slope1 = tl.load(at + OUT * OUT, mask=inside, other=0.0)
        slope2 = tl.load(at + 2 * OUT * OUT, mask=inside, other=0.0)
        slope3 = tl.load(at + 3 * OUT * OUT, mask=inside, other=0.0)
        sum0 += slope0[None, :] * value
        sum1 += slope1[None, :] * value
        sum2 += slope2[None, :] * value
        sum3 += slope3[None, :] * value
    to = out + ((group * OUTPUTS + first) * INPUTS + channel) * 16 + tap
    tl.store(to, tl.sum(sum0, 1))
    tl.store(to + INPUTS * 16, tl.sum(sum1, 1))
    tl.store(to + 2 * INPUTS * 16, tl.sum(sum2, 1))
    tl.store(to + 3 * INPUTS * 16, tl.sum(sum3, 1))


def convolve(
    maps: Tensor, weights: Tensor, bias: Tensor, slope: float, channels_last: bool
) -> Tensor:
    """A layer of convolution and its leaky rectifier.

    Args:
        maps: (N, T, C, S, S), contiguous.
        weights: (N, D, C, 4, 4), contiguous; D is a multiple of 4.
        bias: (N, D), contiguous.
        slope: of the rectifier below zero.
        channels_last: whether the output has its channels last.

    Returns:
        (N, T, D, S - 3, S - 3), or (N, T, S - 3, S - 3, D).
    """
    groups, steps, inputs, side, _ = maps.shape
    outputs, out_side = weights.shape[1], side - 3
    area = out_side * out_side
    shape = (out_side, out_side, outputs) if channels_last else (
        outputs, out_side, out_side
    )  # fmt: skip
    out = maps.new_empty(groups, steps, *shape)
    grid = triton.cdiv(steps * area, PIXELS), groups, outputs // 4
    _correlate[grid](
        maps, weights, bias, maps, out, steps * area, steps, outputs * inputs * 16,
        inputs * 16, 16, 1 if channels_last else area, outputs if channels_last else 1,
        slope, side, out_side, inputs, outputs, 0, PIXELS,
    )  # fmt: skip
    return out


def convolve_backward(
    gradient: Tensor, weights: Tensor, maps: Tensor, slope: float
) -> Tensor:
    """Gradient (N, T, C, S, S) before the rectifier whose output a layer convolves.

    Args:
        gradient: (N, T, D, S - 3, S - 3) of the convolution's output, contiguous.
        weights: (N, D, C, 4, 4), contiguous; C is a multiple of 4.
        maps: (N, T, C, S, S), what the layer convolves, contiguous.
        slope: of the rectifier below zero.
    """
    groups, steps, inputs, side, _ = maps.shape
    outputs, area = weights.shape[1], side * side
    out = maps.new_empty(maps.shape)
    grid = triton.cdiv(steps * area, PIXELS), groups, inputs // 4
    _correlate[grid](
        gradient, weights, weights, maps, out, steps * area, steps,
        outputs * inputs * 16, 16, inputs * 16, area, 1, slope, side - 3, side, outputs,
        inputs, 3, PIXELS,
    )  # fmt: skip
    return out


def kernel_gradient(gradient: Tensor, maps: Tensor) -> Tensor:
    """Gradient (N, D, C, 4, 4) of the kernels of a convolution.

    Args:
        gradient: (N, T, D, S - 3, S - 3) of the convolution's output, contiguous.
        maps: (N, T, C, S, S), what the layer convolves, contiguous.
    """
    groups, steps, inputs, side, _ = maps.shape
    outputs = gradient.shape[2]
    out = maps.new_empty(groups, outputs, inputs, 4, 4)
    grid = groups, inputs, outputs // 4
    _kernel_gradient[grid](
        maps, gradient, out, steps, steps * (side - 3) ** 2, side, side - 3, inputs,
        outputs, PRODUCTS,
    )  # fmt: skip
    return out


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
    """One step of Adam for a part of one trial's weights."""
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
    """One step of Adam, in place, for the active trials.

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
