"""Samples of two robots as one, with a flag in front of x: 1 the novice, 0 the expert.

A regression of both learns what the robots have in common from many samples, and what
the novice has for itself through the flag.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from ownrobot.methods.fine_tuning import expert_of
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.model import Predictor
from sidm.learning.units import Standardisation

#: Samples of the expert that are learnt from, at most.
MOST_EXPERT_SAMPLES = 20_000


class Pooled(Predictor):
    """Predicts transitions (B, T, Y) of the novice by a model that sees the flag."""

    def __init__(self, inner: Predictor):
        super().__init__()
        self.inner = inner

    def loss_weights(self, role: str) -> Tensor | None:
        """Weights (Y,) of the components in equation (1)."""
        return self.inner.loss_weights(role)

    def forward(self, role: str, inputs: Tensor, maps: Tensor, memory=None):
        """Transitions (B, T, Y) in raw units, and the memory of the inner model."""
        return self.inner(role, _with_flag(inputs, 1.0), maps, memory)


def _with_flag(inputs: Tensor, flag: float) -> Tensor:
    """Inputs (..., 1 + X) from inputs (..., X)."""
    return torch.cat([torch.full_like(inputs[..., :1], flag), inputs], -1)


def pooled_datasets(datasets: Datasets, seed: int) -> Datasets:
    """The data of both robots with flags, the expert's at most 20,000 samples."""
    expert = expert_of(datasets)
    most = max(1, MOST_EXPERT_SAMPLES // expert.stored_inputs.shape[1])
    order = np.random.default_rng(seed).permutation(len(expert))
    expert = expert.take(np.sort(order[:most]))
    train, test, validation = (_flagged(part, 1.0) for part in datasets[:3])
    return Datasets(train, test, validation, _flagged(expert, 0.0))


def _flagged(windows: Windows, flag: float) -> Windows:
    return Windows(_with_flag(windows.inputs, flag), windows.targets, windows.maps)


def pooled_units(units: Standardisation) -> Standardisation:
    """The units, with a raw flag in front of x."""
    mean, std = units.input_mean, units.input_std
    return units._replace(
        input_mean=torch.cat([mean.new_zeros(1), mean]),
        input_std=torch.cat([std.new_ones(1), std]),
    )
