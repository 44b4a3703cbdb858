"""A step of an LSTM layer, and its gradient, as one kernel each.

M trials, B trajectories, T steps, H hidden units.
"""

from __future__ import annotations

import triton
import triton.language as tl
from torch import Tensor

UNITS = 32  # hidden units of one program


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
    """A step of an LSTM layer for UNITS hidden units of one trial."""
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
    """An LSTM layer over all steps, from zero states.

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
