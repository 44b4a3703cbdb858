"""Adam on the weights of M trials at once, where each trial decides for itself which of its parts take the step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import torch
from torch import Tensor

BETA1, BETA2, EPSILON = 0.9, 0.999, 1e-8  # PyTorch's


class Moments(NamedTuple):
    """What Adam remembers of a parameter, by PyTorch's names."""

    step: Tensor  # (M,) float32, steps taken
    exp_avg: Tensor  # (M, ...), of the gradient
    exp_avg_sq: Tensor  # (M, ...), of its square


class StackedAdam:
    """Adam with decoupled weight decay, or with an L2 penalty, for stacked parameters.

    Args:
        parameters: (M, ...) each, by name, changed in place.
        decoupled: whether the decay acts on the weights themselves, not through the
            gradient.
    """

    def __init__(self, parameters: Mapping[str, Tensor], decoupled: bool):
        self.parameters, self.decoupled = dict(parameters), decoupled
        first = next(iter(self.parameters.values()))
        # each trial's
        self.learning_rate, self.decay = first.new_zeros(2, len(first)).detach()
        self.moments = {
            name: Moments(
                *(
                    torch.zeros_like(one, requires_grad=False)
                    for one in (self.decay, weights, weights)
                )
            )
            for name, weights in self.parameters.items()
        }

    def put(
        self,
        trial: int,
        learning_rate: float,
        decay: float,
        state: Mapping[str, Tensor],
    ) -> None:
        """Make these a trial's settings and moments, (...) each by 'parameter/exp_avg'; those not given become 0."""
        self.learning_rate[trial], self.decay[trial] = learning_rate, decay
        for name, moments in self.moments.items():
            for what, stacked in moments._asdict().items():
                stacked[trial] = state.get(f"{name}/{what}", torch.zeros(()))

    def get(self, trial: int) -> dict[str, Tensor]:
        """A copy of a trial's moments (...) by the same names, of the parameters that took a step."""
        return {
            f"{name}/{what}": stacked[trial].to("cpu", copy=True)
            for name, moments in self.moments.items()
            if moments.step[trial] > 0
            for what, stacked in moments._asdict().items()
        }

    @torch.no_grad()
    def step(self, gradients: Mapping[str, Tensor], moving: Tensor) -> None:
        """Update the parameters that have `gradients` (M, ...) in the trials that are `moving` (M,)."""
        for name, gradient in gradients.items():
            self._update(self.parameters[name], gradient, self.moments[name], moving)

    def _update(
        self, weights: Tensor, gradient: Tensor, moments: Moments, moving: Tensor
    ) -> None:
        moments.step.add_(moving)
        lead = (-1, *[1] * (weights.ndim - 1))
        # 1 - 0.999 in single precision has lost four digits
        count = moments.step.clamp_min(1).double()
        first, second = (
            (1 - beta**count).to(weights.dtype).view(lead) for beta in (BETA1, BETA2)
        )
        # whatever it is where nothing moves
        gradient = torch.where(moving.view(lead), gradient, 0.0)
        now = moving.to(weights.dtype).view(lead)  # 0 leaves everything as it is
        rate, decay = now * self.learning_rate.view(lead), self.decay.view(lead)
        if self.decoupled:
            weights.mul_(1 - rate * decay)
        else:
            gradient = gradient + decay * weights
        moments.exp_avg.lerp_(gradient, (1 - BETA1) * now)
        moments.exp_avg_sq.lerp_(gradient.square(), (1 - BETA2) * now)
        spread = (moments.exp_avg_sq / second).sqrt_().add_(EPSILON)
        weights.sub_(rate / first * moments.exp_avg / spread)
