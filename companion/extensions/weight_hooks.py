"""Hooks on the weights: a pull towards the initial weights, and a moving average."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping

import torch
from torch import Tensor

from sidm.learning.trainer import Hook, Trainer
from sidm.learning.weights import trainable_parameters

#: Updates: after n of them, the past has at most weight n / (n + WARM_UP).
WARM_UP = 10


class PullToStart(Hook):
    """Pulls the weights towards their initial values after each step.

    L2-SP of Li, Grandvalet and Davoine (2018), decoupled from the gradient in the way
    of decoupled weight decay. `share` is the share of the way back, per unit of
    learning rate.
    """

    def __init__(self, share: float) -> None:
        self.share = share

    def begin(self, trainer: Trainer) -> None:
        """Keep a copy of the initial weights."""
        self.pull = trainer.training.learning_rate * self.share
        self.weights = [p.data for p in trainable_parameters(trainer.model)]
        self.anchor = [weight.clone() for weight in self.weights]

    def after_step(self, trainer: Trainer) -> None:
        """Move the weights a part of the way back."""
        torch._foreach_lerp_(self.weights, self.anchor, self.pull)


class WeightAverage(Hook):
    """Exponential moving average of the weights, which is tested and kept.

    `past` is the weight of the past in the average, above 0 and below 1.
    """

    def __init__(self, past: float) -> None:
        self.past, self.updates = past, 0

    def begin(self, trainer: Trainer) -> None:
        """Start the average at the initial weights."""
        self.weights = [p.data for p in trainable_parameters(trainer.model)]
        self.average = [weight.clone() for weight in self.weights]

    def after_step(self, trainer: Trainer) -> None:
        """Update the average with the new weights."""
        self.updates += 1
        past = min(self.past, self.updates / (self.updates + WARM_UP))
        torch._foreach_lerp_(self.average, self.weights, 1 - past)

    @contextlib.contextmanager
    def testing(self) -> Iterator[None]:
        """Give the model the averaged weights inside the block."""
        trained = [weight.clone() for weight in self.weights]
        for weight, average in zip(self.weights, self.average, strict=True):
            weight.copy_(average)
        try:
            yield
        finally:
            for weight, before in zip(self.weights, trained, strict=True):
                weight.copy_(before)

    def tensors(self) -> dict[str, Tensor]:
        """The averages by number, in the shapes of the weights."""
        return {str(number): tensor for number, tensor in enumerate(self.average)}

    def restore(self, tensors: Mapping[str, Tensor], updates: int) -> None:
        """Put back the averages that `tensors` gave after `updates` updates."""
        for number, tensor in tensors.items():
            self.average[int(number)].copy_(tensor)
        self.updates = updates
