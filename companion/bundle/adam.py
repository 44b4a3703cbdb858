"""Adam for the stacked weights of M trials, each of which steps when it is due."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn

BETAS, EPSILON = (0.9, 0.999), 1e-8  # PyTorch's defaults


class Single(NamedTuple):
    """The optimiser of a trial alone, Adam or AdamW, and what it steps."""

    optimiser: torch.optim.Optimizer
    parameters: Mapping[str, nn.Parameter]  # by their names among the stacked ones


class AdamState(NamedTuple):
    """Adam's state of one stacked parameter; the fields have PyTorch's names."""

    step: Tensor  # (M,) float32, number of steps taken
    exp_avg: Tensor  # (M, ...), moving average of the gradient
    exp_avg_sq: Tensor  # (M, ...), moving average of the squared gradient


class StackedAdam:
    """M optimisers as one.

    Args:
        parameters: (M, ...) each, by name; they are changed in place.
        singles: the optimisers, whose settings and states are taken over. All are of
            one class; AdamW decouples weight decay.
    """

    def __init__(
        self, parameters: Mapping[str, Tensor], singles: Sequence[Single]
    ) -> None:
        self.parameters, self.singles = dict(parameters), singles
        self.decoupled = isinstance(singles[0].optimiser, torch.optim.AdamW)
        device = next(iter(self.parameters.values())).device
        # (M,) each, a value per trial
        self.learning_rate, self.decay = (
            torch.tensor([s.optimiser.param_groups[0][k] for s in singles]).to(device)
            for k in ("lr", "weight_decay")
        )
        self.states = {name: self._state(name) for name in self.parameters}

    def _state(self, name: str) -> AdamState:
        weights = self.parameters[name].detach()
        stacked = AdamState(
            step=torch.zeros_like(self.decay),
            exp_avg=torch.zeros_like(weights),
            exp_avg_sq=torch.zeros_like(weights),
        )
        for trial, (optimiser, parameters) in enumerate(self.singles):
            # a part that this trial does not train has no state
            own = name in parameters and optimiser.state.get(parameters[name])
            for field, value in (own or {}).items():
                getattr(stacked, field)[trial] = value
        return stacked

    def hand_back(self, trial: int) -> None:
        """Give the trial's own optimiser a copy of its state."""
        optimiser, parameters = self.singles[trial]
        for name, parameter in parameters.items():
            state = self.states[name]
            if state.step[trial] > 0:
                optimiser.state[parameter] = {
                    field: stacked[trial].to(parameter.device, copy=True)
                    for field, stacked in state._asdict().items()
                }

    @torch.no_grad()
    def step(self, gradients: Mapping[str, Tensor], active: Tensor) -> None:
        """Update the parameters that have a gradient, in the active trials.

        Args:
            gradients: (M, ...) each, by the parameter's name; anything, also NaN, for
                a trial that is not active.
            active: (M,) bool, which trials take the step.
        """
        for name, gradient in gradients.items():
            self._update(self.parameters[name], gradient, self.states[name], active)

    def _update(
        self, weights: Tensor, gradient: Tensor, state: AdamState, active: Tensor
    ) -> None:
        state.step.add_(active)
        shape = (-1, *[1] * (weights.ndim - 1))  # (M, 1, ...)
        # double: 1 - 0.999 in single precision has lost four digits
        count = state.step.clamp_min(1).double()
        correction1, correction2 = (
            (1 - beta**count).to(weights.dtype).view(shape) for beta in BETAS
        )
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
