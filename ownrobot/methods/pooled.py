"""Samples of two robots as one, with a flag in front of x: 1 the novice, 0 the expert.

A regression of both learns what the robots have in common from many samples, and what
the novice has for itself through the flag.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from sidm.config import ConfigError
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
        return self.inner(role, with_flag(inputs, True), maps, memory)


def with_flag(inputs: Tensor, is_novice: bool) -> Tensor:
    """Inputs (..., 1 + X) from inputs (..., X)."""
    flag = torch.full_like(inputs[..., :1], float(is_novice))
    return torch.cat([flag, inputs], -1)


def pooled_datasets(datasets: Datasets, seed: int) -> Datasets:
    """The data of both robots with flags, the expert's at most 20,000 samples."""
    expert = expert_windows(datasets)
    most = max(1, MOST_EXPERT_SAMPLES // expert.stored_inputs.shape[1])
    order = np.random.default_rng(seed).permutation(len(expert))
    expert = expert.take(np.sort(order[:most]))
    train, test, validation = (_flagged(part, True) for part in datasets[:3])
    return Datasets(train, test, validation, _flagged(expert, False))


def expert_windows(datasets: Datasets) -> Windows:
    """The expert's windows."""
    if datasets.expert is None:
        raise ConfigError(
            "samples of both robots need the expert's data, but datasets.expert is None"
        )
    return datasets.expert


def _flagged(windows: Windows, is_novice: bool) -> Windows:
    inputs = with_flag(windows.inputs, is_novice)
    return Windows(inputs, windows.targets, windows.maps)


def pooled_units(units: Standardisation) -> Standardisation:
    """The units, with a raw flag in front of x."""
    first = units.input_mean.new_zeros(1), units.input_std.new_ones(1)
    return units._replace(
        input_mean=torch.cat([first[0], units.input_mean]),
        input_std=torch.cat([first[1], units.input_std]),
    )


def joined(windows: Windows, others: Windows) -> Windows:
    """Windows of two robots as one."""
    names = ("inputs", "targets", "maps")
    pairs = ([getattr(part, name) for part in (windows, others)] for name in names)
    return Windows(*map(torch.cat, pairs))
