"""What happens to a model's weights at an update: the optimiser's step, a pull to the start, a running average."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import torch
from torch import Tensor, nn

from sidm.learning.settings import Training

WARM_UP = 10  # updates; an average of n has no more of the past than n / (n + WARM_UP)


def learnt(module: nn.Module) -> list[nn.Parameter]:
    """The parameters of a module that are not frozen."""
    return [parameter for parameter in module.parameters() if parameter.requires_grad]


def make_optimiser(module: nn.Module, training: Training) -> torch.optim.Optimizer:
    """Adam with decoupled weight decay (section 4), or with the released code's L2 penalty."""
    adam = torch.optim.AdamW if training.decay == "decoupled" else torch.optim.Adam
    return adam(learnt(module), lr=training.learning_rate, weight_decay=training.weight_decay, fused=True)


class Follower:
    """What follows each step of the prediction's optimiser, as `Training.tether` and `Training.averaging` ask for it.

    The pull toward the starting point is that of Li, Grandvalet and Davoine (2018), apart from the gradient as
    decoupled weight decay is.
    """

    def __init__(self, module: nn.Module, training: Training):
        """`module` has its initial weights."""
        self.weights = [parameter.data for parameter in learnt(module)]
        self.pull = training.learning_rate * training.tether
        self.past = training.averaging
        self.anchor = [weight.clone() for weight in self.weights] if self.pull else []
        self.average = [weight.clone() for weight in self.weights] if self.past else []
        self.updates = 0

    def follow(self) -> None:
        """After an update."""
        if self.anchor:
            torch._foreach_lerp_(self.weights, self.anchor, self.pull)
        if self.average:
            self.updates += 1
            past = min(self.past, self.updates / (self.updates + WARM_UP))
            torch._foreach_lerp_(self.average, self.weights, 1 - past)

    @contextlib.contextmanager
    def averaged(self) -> Iterator[None]:
        """The module has the averaged weights inside the block, where an average is taken."""
        kept = [weight.clone() for weight in self.weights] if self.average else []
        for weights, inside in zip(self.weights, self.average, strict=False):
            weights.copy_(inside)
        try:
            yield
        finally:
            for weights, before in zip(self.weights, kept, strict=False):
                weights.copy_(before)

    def tensors(self) -> dict[str, Tensor]:
        """What a checkpoint has to keep, by name: the averages, in the weights' shapes."""
        return {str(number): tensor for number, tensor in enumerate(self.average)}

    def restore(self, tensors: dict[str, Tensor], updates: int) -> None:
        """Put back what `tensors` gave, after so many updates."""
        for number, tensor in tensors.items():
            self.average[int(number)].copy_(tensor)
        self.updates = updates
