"""The encoder's convolutions in Numba: 4 x 4 kernels without padding.

The number of output channels of each layer is a multiple of 4. The vectors of a
processor run over maps: LANES maps lie side by side as the innermost dimension, so that
a row of an output is contiguous in memory, and each kernel adds shifted rows of its
input to it. A group of LANES maps stays in the cache from the pixels to the features.
The backward pass computes the first layer again, which is faster than reading it from
memory.

There are N maps of P x P pixels; a side has P - 3 pixels after the first layer and
P - 6 after the second.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

LANES = 16  # maps in a group: a multiple of every processor's vector length
TAPS = 4  # side of the kernels, pixels
BLOCK = 4  # output channels that share the loads of an input row

#: the compiler may reorder sums and fuse products; NaN and infinity stay as they are
OPTIONS: dict[str, Any] = {"fastmath": {"reassoc", "contract", "nsz"}}


def compiled(function: Callable) -> Any:
    """Compile `function` at its first call; its machine code is kept on disk."""
    try:
        return njit(**OPTIONS, cache=True)(function)
    except RuntimeError:  # no folder for the machine code: compile it every time
        return njit(**OPTIONS)(function)


def inlined(function: Callable) -> Any:
    """Compile `function` into the machine code of the functions that call it."""
    return njit(**OPTIONS, inline="always")(function)


@compiled
def forward(maps, w1, b1, w2, b2, slope, mean, std, features):
    """Write the features of maps (N, P, P), standardised by `mean` and `std`.

    A row of `features` begins with R R C numbers, R = P - 6, with the channels
    innermost; the rest of the row is left as it is.
    """
    side, channels = maps.shape[1], len(w2)
    width = (side - 6) * channels  # numbers of a row of pixels
    x = np.empty((1, side, side * LANES), maps.dtype)
    inner = np.empty((len(w1), side - 3, (side - 3) * LANES), maps.dtype)
    outer = np.empty((channels, side - 6, (side - 6) * LANES), maps.dtype)
    for start in range(0, len(maps), LANES):
        count = min(LANES, len(maps) - start)
        _standardise(maps[start : start + count], mean, std, x)
        _convolve(x, w1, b1, inner, slope)
        _convolve(inner, w2, b2, outer, slope)
        for i in range(side - 6):  # row by row: a row fits into the nearest cache
            for lane in range(count):
                row = features[start + lane, i * width : (i + 1) * width]
                for c in range(channels):
                    for j in range(side - 6):
                        row[j * channels + c] = outer[c, i, j * LANES + lane]


@compiled
def backward(
    maps, w1, b1, flipped, slope, mean, std, features, gradient, gw1, gb1, gw2, gb2
):
    """Add the gradients of weights and biases to gw1, gb1, gw2 and gb2.

    `gradient` is that of the `features` which `forward` wrote. `flipped` are the second
    layer's weights (in, out, 4, 4) with both sides reversed: a convolution with them
    takes the gradient, in a margin of zeros, back to the first layer's outputs.
    """
    side, channels, dtype = maps.shape[1], len(gw2), maps.dtype
    rest = side - 6
    width = rest * channels  # numbers of a row of pixels
    x = np.empty((1, side, side * LANES), dtype)
    inner = np.empty((len(w1), side - 3, (side - 3) * LANES), dtype)
    back = np.empty_like(inner)
    framed = np.zeros((channels, rest + 6, (rest + 6) * LANES), dtype)
    no_bias, no_slope = np.zeros(len(w1), dtype), dtype.type(1)
    for start in range(0, len(maps), LANES):
        count = min(LANES, len(maps) - start)
        _standardise(maps[start : start + count], mean, std, x)
        _convolve(x, w1, b1, inner, slope)
        if count < LANES:
            framed[:] = 0
        for i in range(rest):
            for lane in range(count):
                row = gradient[start + lane, i * width : (i + 1) * width]
                signs = features[start + lane, i * width : (i + 1) * width]
                for c in range(channels):
                    for j in range(rest):
                        value = row[j * channels + c]
                        if not signs[j * channels + c] > 0:
                            value *= slope
                        framed[c, i + 3, (j + 3) * LANES + lane] = value
        _add_weight_gradient(framed, 3, inner, gw2, gb2)
        _convolve(framed, flipped, no_bias, back, no_slope)
        _leaky_relu_gradient(back, inner, slope)
        _add_weight_gradient(back, 0, x, gw1, gb1)


@compiled
def _standardise(maps, mean, std, x):
    """Write up to LANES maps (n, P, P) side by side into x (1, P, P LANES); or 0."""
    if len(maps) < LANES:
        x[:] = 0
    for i in range(maps.shape[1]):
        for lane in range(len(maps)):
            for j in range(maps.shape[2]):
                x[0, i, j * LANES + lane] = (maps[lane, i, j] - mean) / std


@compiled
def _leaky_relu_gradient(gradient, outputs, slope):
    """Turn the gradient of a leaky ReLU's outputs into that of its inputs, in place."""
    flat, signs = gradient.reshape(-1), outputs.reshape(-1)
    for m in range(flat.size):
        flat[m] = flat[m] if signs[m] > 0 else slope * flat[m]


@compiled
def _convolve(x, w, b, out, slope):
    """Compute a convolution and its leaky ReLU; a slope of 1 means no ReLU.

    x is (Ci, P, P LANES), w (Co, Ci, 4, 4), b (Co,); out (Co, P - 3, (P - 3) LANES) is
    overwritten.
    """
    n = out.shape[2]
    for i in range(out.shape[1]):
        for c in range(0, len(out), BLOCK):
            first, second = out[c, i], out[c + 1, i]
            third, fourth = out[c + 2, i], out[c + 3, i]
            first[:] = b[c]
            second[:] = b[c + 1]
            third[:] = b[c + 2]
            fourth[:] = b[c + 3]
            for k in range(len(x)):
                for j in range(TAPS):
                    p, q = w[c, k, j], w[c + 1, k, j]
                    r, s = w[c + 2, k, j], w[c + 3, k, j]
                    _add_taps(first, second, third, fourth, x[k, i + j], p, q, r, s, n)
            for m in range(n):
                first[m] = first[m] if first[m] > 0 else slope * first[m]
                second[m] = second[m] if second[m] > 0 else slope * second[m]
                third[m] = third[m] if third[m] > 0 else slope * third[m]
                fourth[m] = fourth[m] if fourth[m] > 0 else slope * fourth[m]


@inlined
def _add_taps(first, second, third, fourth, row, p, q, r, s, n):
    """Add a row, shifted by 0 to 3 pixels, times p, q, r, s (4,), to four rows of n."""
    # the compiler does not make vectors where the loop computes offsets
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
    """Add a layer's gradients to those of its weights gw and its biases gb.

    gw is (Co, Ci, 4, 4) and gb (Co,). The layer's inputs x are (Ci, P, P LANES); the
    gradient of its outputs, (Co, P - 3, (P - 3) LANES), has a margin of `margin` pixels
    around it.
    """
    begin, n = margin * LANES, (x.shape[1] - 3) * LANES
    end = begin + n
    for i in range(x.shape[1] - 3):
        for c in range(0, len(gradient), BLOCK):
            first = gradient[c, i + margin][begin:end]
            second = gradient[c + 1, i + margin][begin:end]
            third = gradient[c + 2, i + margin][begin:end]
            fourth = gradient[c + 3, i + margin][begin:end]
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
    """The 16 products of four rows of n with a fifth, shifted by 0 to 3 pixels."""
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
