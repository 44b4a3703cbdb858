"""The SIDM's LSTM for M trials at once: LSTM cells with stacked weights.

`torch.func.vmap` cannot batch `nn.LSTM` over weights, and its GPU kernels use one set
of weights. M trials, B trajectories, T steps, H hidden units.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from companion.bundle.fused import FusedRecurrence, fuses_steps


class Recurrence(torch.autograd.Function):
    """An LSTM layer over all steps, from zero states.

    The gradient of the recurrent weights is one product over all steps; autograd would
    add up T products.
    """

    @staticmethod
    def forward(ctx, inputs: Tensor, recurrent: Tensor) -> Tensor:
        """Hidden states of the layer."""
        trials, steps, batch, width = inputs.shape
        output = inputs.new_zeros(trials, batch, width // 4)
        cell = torch.zeros_like(output)
        gates, cells, outputs = torch.empty_like(inputs), [], []
        for step in range(steps):
            raw = torch.baddbmm(inputs[:, step], output, recurrent.mT)
            i, f, g, o = raw.chunk(4, dim=-1)  # the order of nn.LSTM
            gate = torch.cat([i.sigmoid(), f.sigmoid(), g.tanh(), o.sigmoid()], dim=-1)
            i, f, g, o = gate.chunk(4, dim=-1)
            cell = f * cell + i * g
            output = o * cell.tanh()
            gates[:, step] = gate
            cells.append(cell)
            outputs.append(output)
        hidden = torch.stack(outputs, dim=1)
        ctx.save_for_backward(gates, torch.stack(cells, dim=1), hidden, recurrent)
        return hidden

    @staticmethod
    @once_differentiable
    def backward(ctx, hidden_gradient: Tensor) -> tuple[Tensor, Tensor]:
        """Gradients of both inputs of `forward`."""
        gates, cells, hidden, recurrent = ctx.saved_tensors
        gradients = torch.empty_like(gates)
        output = torch.zeros_like(hidden[:, 0])  # from here on gradients of both
        cell = torch.zeros_like(output)
        for step in reversed(range(hidden.shape[1])):
            i, f, g, o = gates[:, step].chunk(4, dim=-1)
            previous = cells[:, step - 1] if step else torch.zeros_like(cell)
            tanh = cells[:, step].tanh()
            output = output + hidden_gradient[:, step]
            cell = cell + output * o * (1 - tanh * tanh)
            slopes = (
                cell * g * i * (1 - i),
                cell * previous * f * (1 - f),
                cell * i * (1 - g * g),
                output * tanh * o * (1 - o),
            )
            gradient = torch.cat(slopes, dim=-1)
            gradients[:, step] = gradient
            output, cell = gradient @ recurrent, cell * f
        before = hidden[:, :-1].flatten(1, 2)  # (M, (T - 1) B, H)
        return gradients, gradients[:, 1:].flatten(1, 2).mT @ before


def lstm(weights: Mapping[str, Tensor], inputs: Tensor) -> Tensor:
    """Hidden states of the last LSTM layer, from zero states at the first step.

    Args:
        weights: those of `nn.LSTM` by its names, stacked: 'weight_ih_l0' (M, 4 H, K),
            'bias_hh_l0' (M, 4 H), ...
        inputs: (M, B, T, K).

    Returns:
        (M, B, T, H).
    """
    hidden = inputs.transpose(1, 2)  # (M, T, B, K)
    names = ("weight_ih", "weight_hh", "bias_ih", "bias_hh")
    for layer in range(sum(name.startswith("weight_ih") for name in weights)):
        w_ih, w_hh, b_ih, b_hh = (weights[f"{name}_l{layer}"] for name in names)
        bias = (b_ih + b_hh).unsqueeze(1)
        gates = torch.baddbmm(bias, hidden.flatten(1, 2), w_ih.mT)
        gates = gates.unflatten(1, hidden.shape[1:3])
        fused = fuses_steps(gates)
        hidden = (FusedRecurrence if fused else Recurrence).apply(gates, w_hh)
    return hidden.transpose(1, 2)
