"""The encoder's convolutions and their gradients.

N = M B trajectories of T steps, each with its own kernels of convolution; C and D
channels, S map pixels a side.
"""

from __future__ import annotations

import triton
import triton.language as tl
from torch import Tensor

PIXELS = 1024  # that one program convolves
PRODUCTS = 128  # pixels at a time in the gradient of a kernel of convolution


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
