"""Adam for the stacked weights of M trials.

Each trial decides at every step which of its parts are updated.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import torch
from torch import Tensor

from companion.bundle.fused import fits_kernels

BETAS, EPSILON = (0.9, 0.999), 1e-8  # PyTorch's defaults


class AdamState(NamedTuple):
    """Adam's state of one stacked parameter; the fields have PyTorch's names."""

    step: Tensor  # (M,) float32, number of steps taken
    exp_avg: Tensor  # (M, ...), moving average of the gradient
    exp_avg_sq: Tensor  # (M, ...), moving average of the squared gradient


class StackedAdam:
    """Adam with decoupled weight decay, or with an L2 penalty, for stacked parameters.

    Args:
        parameters: (M, ...) each, by name; they are changed in place.
        decoupled: whether weight decay acts on the weights directly (AdamW), not
            through the gradient (L2 penalty).
    """

    def __init__(self, parameters: Mapping[str, Tensor], decoupled: bool):
        self.parameters, self.decoupled = dict(parameters), decoupled
        first = next(iter(self.parameters.values()))
        # (M,) each, a value per trial
        self.learning_rate, self.decay = first.new_zeros(2, len(first)).detach()
        self.states = {
            name: AdamState(
                step=torch.zeros_like(self.decay),
                exp_avg=torch.zeros_like(weights, requires_grad=False),
                exp_avg_sq=torch.zeros_like(weights, requires_grad=False),
            )
            for name, weights in self.parameters.items()
        }

    def put(
        self,
        trial: int,
        learning_rate: float,
        decay: float,
        tensors: Mapping[str, Tensor],
    ) -> None:
        """Set the settings and the Adam state of one trial.

        Args:
            trial: its index, below M.
            learning_rate: its learning rate.
            decay: its weight decay.
            tensors: its state, (...) each, by 'parameter/exp_avg' and the like; what
                is missing becomes 0.
        """
        self.learning_rate[trial], self.decay[trial] = learning_rate, decay
        for name, state in self.states.items():
            for field, stacked in state._asdict().items():
                stacked[trial] = tensors.get(f"{name}/{field}", torch.zeros(()))

    def get(self, trial: int) -> dict[str, Tensor]:
        """A copy of one trial's Adam state on the CPU, named as in `put`.

        Parameters that never took a step are left out.
        """
        return {
            f"{name}/{field}": stacked[trial].to("cpu", copy=True)
            for name, state in self.states.items()
            if state.step[trial] > 0
            for field, stacked in state._asdict().items()
        }

    @torch.no_grad()
    def step(self, gradients: Mapping[str, Tensor], active: Tensor) -> None:
        """Update the parameters that have a gradient, in the active trials.

        Args:
            gradients: (M, ...) each, by the parameter's name.
            active: (M,) bool, which trials take the step.
        """
        for name, gradient in gradients.items():
            self._update(self.parameters[name], gradient, self.states[name], active)

    def _update(
        self, weights: Tensor, gradient: Tensor, state: AdamState, active: Tensor
    ) -> None:
        state.step.add_(active)
        if fits_kernels(weights):
            from companion.bundle.kernels.adam import adam_step

            adam_step(
                weights,
                gradient.contiguous(),
                state,
                active,
                (self.learning_rate, self.decay),
                (*BETAS, EPSILON),
                self.decoupled,
            )
            return
        shape = (-1, *[1] * (weights.ndim - 1))  # (M, 1, ...)
        # double: 1 - 0.999 in single precision has lost four digits
        count = state.step.clamp_min(1).double()
        correction1, correction2 = (
            (1 - beta**count).to(weights.dtype).view(shape) for beta in BETAS
        )
        # the gradient of a trial that is not active may be anything, also NaN
        gradient = torch.where(active.view(shape), gradient, 0.0)
        factor = active.to(weights.dtype).view(shape)  # 0 changes nothing
        rate, decay = factor * self.learning_rate.view(shape), self.decay.view(shape)
        if self.decoupled:
            weights.mul_(1 - rate * decay)
        else:
            gradient = gradient + decay * weights
        state.exp_avg.lerp_(gradient, (1 - BETAS[0]) * factor)
        state.exp_avg_sq.lerp_(gradient.square(), (1 - BETAS[1]) * factor)
        denominator = (state.exp_avg_sq / correction2).sqrt_().add_(EPSILON)
        weights.sub_(rate / correction1 * state.exp_avg / denominator)
