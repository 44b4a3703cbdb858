"""What follows each step of a training: weights pulled to where they began, and their average."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping

import torch
from torch import Tensor

from sidm.learning.trainer import Hook, Trainer
from sidm.learning.weights import learnt

WARM_UP = 10  # updates; an average of n has no more of the past than n / (n + WARM_UP)


class PullToStart(Hook):
    """Weights are pulled to their start, apart from the gradient as decoupled weight decay is.

    After Li, Grandvalet and Davoine (2018), L2-SP.

    Args:
        share: of the way back, a unit of learning rate.
    """

    def __init__(self, share: float) -> None:
        self.share = share

    def begin(self, trainer: Trainer) -> None:
        """Keep the initial weights."""
        self.pull = trainer.training.learning_rate * self.share
        self.weights = [parameter.data for parameter in learnt(trainer.model)]
        self.anchor = [weight.clone() for weight in self.weights]

    def after_step(self, trainer: Trainer) -> None:
        """A part of the way back."""
        torch._foreach_lerp_(self.weights, self.anchor, self.pull)


class WeightAverage(Hook):
    """The average of the weights is what is tested and kept.

    Args:
        past: weight of the past in the average, above 0 and below 1.
    """

    def __init__(self, past: float) -> None:
        self.past, self.updates = past, 0

    def begin(self, trainer: Trainer) -> None:
        """The average begins as the initial weights."""
        self.weights = [parameter.data for parameter in learnt(trainer.model)]
        self.average = [weight.clone() for weight in self.weights]

    def after_step(self, trainer: Trainer) -> None:
        """Take in the new weights."""
        self.updates += 1
        past = min(self.past, self.updates / (self.updates + WARM_UP))
        torch._foreach_lerp_(self.average, self.weights, 1 - past)

    @contextlib.contextmanager
    def testing(self) -> Iterator[None]:
        """The model has the averaged weights inside the block."""
        kept = [weight.clone() for weight in self.weights]
        for weights, inside in zip(self.weights, self.average, strict=True):
            weights.copy_(inside)
        try:
            yield
        finally:
            for weights, before in zip(self.weights, kept, strict=True):
                weights.copy_(before)

    def tensors(self) -> dict[str, Tensor]:
        """The averages, in the weights' shapes."""
        return {str(number): tensor for number, tensor in enumerate(self.average)}

    def restore(self, tensors: Mapping[str, Tensor], updates: int) -> None:
        """Put back the averages after so many updates."""
        for number, tensor in tensors.items():
            self.average[int(number)].copy_(tensor)
        self.updates = updates
