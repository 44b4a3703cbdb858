"""A frozen model and a learned correction: the novice learns what the expert's model gets wrong."""

from __future__ import annotations

import torch
from torch import Tensor

from sidm.config import ConfigError
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.evaluation import EVALUATION_BATCH
from sidm.learning.model import DynamicsModel, Predictor
from sidm.learning.units import Standardisation


class Corrected(Predictor):
    """Predicts the sum of what two models predict, both with the novice's parts alone."""

    def __init__(self, base: DynamicsModel, correction: Predictor):
        super().__init__()
        self.base, self.correction = base, correction

    def forward(self, role: str, inputs: Tensor, maps: Tensor, memory=None):
        """Transitions (B, T, 13), raw units, as DynamicsModel; the memory is that of both."""
        first, second = memory or (None, None)
        predicted, first = self.base(role, inputs, maps, first)
        missing, second = self.correction(role, inputs, maps, second)
        return predicted + missing, (first, second)


def left_over(datasets: Datasets, base: DynamicsModel) -> Datasets:
    """The novice's data, with what `base` leaves unexplained of each transition for a target."""
    sets = {
        name: _unexplained(getattr(datasets, name), base)
        for name in ("train", "test", "validation")
    }
    return datasets._replace(**sets)


def _unexplained(motion: Windows, base: DynamicsModel) -> Windows:
    whole = motion.take(range(len(motion)))
    with torch.inference_mode():
        predicted = [
            base("novice", part.inputs.to(base.device), part.maps.to(base.device))[
                0
            ].cpu()
            for part in whole.split(EVALUATION_BATCH)
        ]
    return Windows(whole.inputs, whole.targets - torch.cat(predicted), whole.maps)


def units(datasets: Datasets) -> Standardisation:
    """Of a correction: the expert's as for every method, but about zero, where a correction begins.

    Raises:
        ConfigError: there are no data of the expert.
    """
    if datasets.expert is None:
        raise ConfigError(
            "a correction needs the expert's data, but datasets.expert is None"
        )
    found = Standardisation.of(datasets.expert)
    return found._replace(target_mean=torch.zeros_like(found.target_mean))
