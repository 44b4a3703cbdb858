"""The encoder's convolutions in Numba: kernels of 4 x 4, no padding, the channels of each output a multiple of 4.

The vectors of a processor run over maps: LANES of them lie side by side as the
innermost dimension, so that a row of an output is one contiguous run of numbers, to
which each kernel adds shifted rows of its input. A group of LANES maps stays in the
cache from the pixels to the features. The backward pass computes the first layer again,
which is faster than fetching it from memory.

N maps of P x P pixels; behind the layers a side is P - 3 and P - 6.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

LANES = 16  # maps of a group: a multiple of every processor's vectors
TAPS = 4  # a side of the kernels
BLOCK = 4  # output channels that share the loads of an input row

#: Sums may run in any order and products be fused; what is not a number stays so.
OPTIONS: dict[str, Any] = {"fastmath": {"reassoc", "contract", "nsz"}}


def compiled(function: Callable) -> Any:
    """`function` as machine code, made when it is first called and kept on disk where there is a place for it."""
    try:
        return njit(**OPTIONS, cache=True)(function)
    except RuntimeError:  # no folder to keep it in
        return njit(**OPTIONS)(function)


def inlined(function: Callable) -> Any:
    """`function` as a part of the machine code of those that call it."""
    return njit(**OPTIONS, inline="always")(function)


@compiled
def forward(maps, w1, b1, w2, b2, slope, mean, std, found):
    """Writes features of maps (N, P, P), with a mean and a standard deviation, into `found`.

    Its rows begin with R R C features, R = P - 6, the channels innermost; what stands
    behind them stays.
    """
    side, channels = maps.shape[1], len(w2)
    x = np.empty((1, side, side * LANES), maps.dtype)
    inner = np.empty((len(w1), side - 3, (side - 3) * LANES), maps.dtype)
    outer = np.empty((channels, side - 6, (side - 6) * LANES), maps.dtype)
    for start in range(0, len(maps), LANES):
        count = min(LANES, len(maps) - start)
        _put_maps(maps[start : start + count], mean, std, x)
        _convolve(x, w1, b1, inner, slope)
        _convolve(inner, w2, b2, outer, slope)
        for i in range(side - 6):  # row by row, which the nearest cache holds
            for lane in range(count):
                row = found[
                    start + lane,
                    i * (side - 6) * channels : (i + 1) * (side - 6) * channels,
                ]
                for c in range(channels):
                    for j in range(side - 6):
                        row[j * channels + c] = outer[c, i, j * LANES + lane]


@compiled
def backward(
    maps, w1, b1, turned, slope, mean, std, found, gradient, gw1, gb1, gw2, gb2
):
    """Adds to gw1, gb1, gw2 and gb2 what a gradient of what `forward` found gives.

    `turned` are the second layer's weights (in, out, 4, 4), both sides reversed: a
    convolution with them takes the gradient, in a margin of zeros, back to the first
    layer's outputs.
    """
    side, channels, dtype = maps.shape[1], len(gw2), maps.dtype
    rest = side - 6
    x = np.empty((1, side, side * LANES), dtype)
    inner = np.empty((len(w1), side - 3, (side - 3) * LANES), dtype)
    back = np.empty_like(inner)
    framed = np.zeros((channels, rest + 6, (rest + 6) * LANES), dtype)
    nothing, one = np.zeros(len(w1), dtype), dtype.type(1)
    for start in range(0, len(maps), LANES):
        count = min(LANES, len(maps) - start)
        _put_maps(maps[start : start + count], mean, std, x)
        _convolve(x, w1, b1, inner, slope)
        if count < LANES:
            framed[:] = 0
        for i in range(rest):
            for lane in range(count):
                own = gradient[
                    start + lane, i * rest * channels : (i + 1) * rest * channels
                ]
                signs = found[
                    start + lane, i * rest * channels : (i + 1) * rest * channels
                ]
                for c in range(channels):
                    for j in range(rest):
                        value = own[j * channels + c]
                        if not signs[j * channels + c] > 0:
                            value *= slope
                        framed[c, i + 3, (j + 3) * LANES + lane] = value
        _add_weight_gradient(framed, 3, inner, gw2, gb2)
        _convolve(framed, turned, nothing, back, one)
        _turn_back(back, inner, slope)
        _add_weight_gradient(back, 0, x, gw1, gb1)


@compiled
def _put_maps(maps, mean, std, x):
    """Up to LANES maps (n, P, P), in units, side by side into x (1, P, P LANES); the other lanes become 0."""
    if len(maps) < LANES:
        x[:] = 0
    for i in range(maps.shape[1]):
        for lane in range(len(maps)):
            for j in range(maps.shape[2]):
                x[0, i, j * LANES + lane] = (maps[lane, i, j] - mean) / std


@compiled
def _turn_back(gradient, outputs, slope):
    """The gradient of a leaky ReLU's outputs becomes that of its inputs, in place."""
    flat, signs = gradient.reshape(-1), outputs.reshape(-1)
    for m in range(flat.size):
        flat[m] = flat[m] if signs[m] > 0 else slope * flat[m]


@compiled
def _convolve(x, w, b, out, slope):
    """A convolution and its leaky ReLU (with a slope of 1 none), for lanes side by side.

    x is (Ci, P, P LANES), w (Co, Ci, 4, 4), b (Co,); out (Co, P - 3, (P - 3) LANES) is
    overwritten.
    """
    n = out.shape[2]
    for i in range(out.shape[1]):
        for c in range(0, len(out), BLOCK):
            first, second, third, fourth = (
                out[c, i],
                out[c + 1, i],
                out[c + 2, i],
                out[c + 3, i],
            )
            first[:] = b[c]
            second[:] = b[c + 1]
            third[:] = b[c + 2]
            fourth[:] = b[c + 3]
            for k in range(len(x)):
                for j in range(TAPS):
                    _add_taps(
                        first,
                        second,
                        third,
                        fourth,
                        x[k, i + j],
                        w[c, k, j],
                        w[c + 1, k, j],
                        w[c + 2, k, j],
                        w[c + 3, k, j],
                        n,
                    )
            for m in range(n):
                first[m] = first[m] if first[m] > 0 else slope * first[m]
                second[m] = second[m] if second[m] > 0 else slope * second[m]
                third[m] = third[m] if third[m] > 0 else slope * third[m]
                fourth[m] = fourth[m] if fourth[m] > 0 else slope * fourth[m]


@inlined
def _add_taps(first, second, third, fourth, row, p, q, r, s, n):
    """Adds to four rows of n numbers a fifth, shifted by 0 to 3 pixels, with each row's weights p, q, r, s (4,)."""
    # offsets inside the loop would not be vectors
    o0, o1, o2, o3 = first[0:n], second[0:n], third[0:n], fourth[0:n]
    a0, a1 = row[0:n], row[LANES : LANES + n]
    a2, a3 = row[2 * LANES : 2 * LANES + n], row[3 * LANES : 3 * LANES + n]
    p0, p1, p2, p3 = p[0], p[1], p[2], p[3]
    q0, q1, q2, q3 = q[0], q[1], q[2], q[3]
    r0, r1, r2, r3 = r[0], r[1], r[2], r[3]
    s0, s1, s2, s3 = s[0], s[1], s[2], s[3]
    for m in range(n):
        a, b, c, d = a0[m], a1[m], a2[m], a3[m]
        o0[m] += p0 * a + p1 * b + p2 * c + p3 * d
        o1[m] += q0 * a + q1 * b + q2 * c + q3 * d
        o2[m] += r0 * a + r1 * b + r2 * c + r3 * d
        o3[m] += s0 * a + s1 * b + s2 * c + s3 * d


@compiled
def _add_weight_gradient(gradient, margin, x, gw, gb):
    """Adds to gw (Co, Ci, 4, 4) and gb (Co,) what the gradient of a layer's outputs gives at its inputs x.

    x is (Ci, P, P LANES); the gradient, (Co, P - 3, (P - 3) LANES), stands inside a
    margin of so many pixels.
    """
    begin, n = margin * LANES, (x.shape[1] - 3) * LANES
    end = begin + n
    for i in range(x.shape[1] - 3):
        for c in range(0, len(gradient), BLOCK):
            first, second = (
                gradient[c, i + margin][begin:end],
                gradient[c + 1, i + margin][begin:end],
            )
            third, fourth = (
                gradient[c + 2, i + margin][begin:end],
                gradient[c + 3, i + margin][begin:end],
            )
            gb[c] += first.sum()
            gb[c + 1] += second.sum()
            gb[c + 2] += third.sum()
            gb[c + 3] += fourth.sum()
            for k in range(len(x)):
                for j in range(TAPS):
                    products = _inner_products(
                        first, second, third, fourth, x[k, i + j], n
                    )
                    for o in range(BLOCK):
                        for t in range(TAPS):
                            gw[c + o, k, j, t] += products[TAPS * o + t]


@inlined
def _inner_products(first, second, third, fourth, row, n):
    """Inner products of four rows of n numbers, one after the other, with a fifth shifted by 0 to 3 pixels: 16."""
    o0, o1, o2, o3 = first[0:n], second[0:n], third[0:n], fourth[0:n]
    a0, a1 = row[0:n], row[LANES : LANES + n]
    a2, a3 = row[2 * LANES : 2 * LANES + n], row[3 * LANES : 3 * LANES + n]
    zero = row.dtype.type(0)
    p0 = p1 = p2 = p3 = q0 = q1 = q2 = q3 = zero
    r0 = r1 = r2 = r3 = s0 = s1 = s2 = s3 = zero
    for m in range(n):
        p, q, r, s = o0[m], o1[m], o2[m], o3[m]
        a, b, c, d = a0[m], a1[m], a2[m], a3[m]
        p0 += p * a
        p1 += p * b
        p2 += p * c
        p3 += p * d
        q0 += q * a
        q1 += q * b
        q2 += q * c
        q3 += q * d
        r0 += r * a
        r1 += r * b
        r2 += r * c
        r3 += r * d
        s0 += s * a
        s1 += s * b
        s2 += s * c
        s3 += s * d
    return p0, p1, p2, p3, q0, q1, q2, q3, r0, r1, r2, r3, s0, s1, s2, s3
