"""The SIDM's LSTM for M trials at once: cells over stacked weights.

`nn.LSTM` cannot be batched over weights, and its kernels on a GPU serve one set of
them. M trials, B trajectories, T steps.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable


class Recurrence(torch.autograd.Function):
    """One LSTM layer along the steps, from zero states.

    The gradient of the recurrent weights is one product over all steps, where recorded
    steps would add up T of them.
    """

    @staticmethod
    def forward(ctx, inward: Tensor, back: Tensor) -> Tensor:
        """Hidden states (M, T, B, H) of gates (M, T, B, 4 H) before the recurrent product; `back` is (M, 4 H, H)."""
        trials, steps, batch, width = inward.shape
        output = inward.new_zeros(trials, batch, width // 4)
        cell = torch.zeros_like(output)
        gates, cells, outputs = torch.empty_like(inward), [], []
        for step in range(steps):
            raw = torch.baddbmm(inward[:, step], output, back.mT)
            take, forget, new, give = raw.chunk(4, dim=-1)  # the order of nn.LSTM
            now = torch.cat(
                [take.sigmoid(), forget.sigmoid(), new.tanh(), give.sigmoid()], dim=-1
            )
            take, forget, new, give = now.chunk(4, dim=-1)
            cell = forget * cell + take * new
            output = give * cell.tanh()
            gates[:, step] = now
            cells.append(cell)
            outputs.append(output)
        hidden = torch.stack(outputs, dim=1)
        ctx.save_for_backward(gates, torch.stack(cells, dim=1), hidden, back)
        return hidden

    @staticmethod
    @once_differentiable
    def backward(ctx, wanted: Tensor) -> tuple[Tensor, Tensor]:
        """Gradients of the gates and of `back` from that of the hidden states (M, T, B, H)."""
        gates, cells, hidden, back = ctx.saved_tensors
        slopes = torch.empty_like(gates)
        output = torch.zeros_like(hidden[:, 0])
        cell = torch.zeros_like(output)
        for step in reversed(range(hidden.shape[1])):
            take, forget, new, give = gates[:, step].chunk(4, dim=-1)
            before = cells[:, step - 1] if step else torch.zeros_like(cell)
            bent = cells[:, step].tanh()
            output = output + wanted[:, step]
            cell = cell + output * give * (1 - bent * bent)
            slope = torch.cat(
                [
                    cell * new * take * (1 - take),
                    cell * before * forget * (1 - forget),
                    cell * take * (1 - new * new),
                    output * bent * give * (1 - give),
                ],
                dim=-1,
            )
            slopes[:, step] = slope
            output, cell = slope @ back, cell * forget
        earlier = hidden[:, :-1].flatten(1, 2)  # (M, (T - 1) B, H)
        return slopes, slopes[:, 1:].flatten(1, 2).mT @ earlier


def lstm(weights: Mapping[str, Tensor], inputs: Tensor) -> Tensor:
    """Hidden states of the last layer, trajectories beginning here.

    Args:
        weights: those of `nn.LSTM` by its names, stacked: 'weight_ih_l0' (M, 4 H, K),
            'bias_hh_l0' (M, 4 H), ...
        inputs: (M, B, T, K).

    Returns:
        (M, B, T, H).
    """
    hidden = inputs.transpose(1, 2)  # (M, T, B, K)
    for layer in range(sum(name.startswith("weight_ih") for name in weights)):
        inward, back, first, second = (
            weights[f"{name}_l{layer}"]
            for name in ("weight_ih", "weight_hh", "bias_ih", "bias_hh")
        )
        gates = torch.baddbmm(
            (first + second).unsqueeze(1), hidden.flatten(1, 2), inward.mT
        )
        hidden = Recurrence.apply(gates.unflatten(1, hidden.shape[1:3]), back)
    return hidden.transpose(1, 2)
