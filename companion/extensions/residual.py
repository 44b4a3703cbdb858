"""A fixed model of the expert with a correction that is learnt from the novice."""

from __future__ import annotations

import torch
from torch import Tensor

from ownrobot.methods.fine_tuning import expert_of
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.evaluation import EVALUATION_BATCH
from sidm.learning.model import DynamicsModel, Predictor
from sidm.learning.units import Standardisation


class Corrected(Predictor):
    """Predicts the sum of a fixed model's predictions and of a correction."""

    def __init__(self, base: DynamicsModel, correction: Predictor):
        super().__init__()
        self.base, self.correction = base, correction

    def forward(self, role: str, inputs: Tensor, maps: Tensor, memory=None):
        """Transitions (B, T, 13) in raw units, and the memories of both models."""
        of_base, of_correction = memory or (None, None)
        predicted, of_base = self.base(role, inputs, maps, of_base)
        correction, of_correction = self.correction(role, inputs, maps, of_correction)
        return predicted + correction, (of_base, of_correction)


def residual_datasets(datasets: Datasets, base: DynamicsModel) -> Datasets:
    """The novice's data with targets minus the transitions that `base` predicts."""
    train, test, validation = (_residuals(part, base) for part in datasets[:3])
    return datasets._replace(train=train, test=test, validation=validation)


def _residuals(windows: Windows, base: DynamicsModel) -> Windows:
    copy, device = windows.take(range(len(windows))), base.device
    predicted = []
    with torch.inference_mode():
        for part in copy.split(EVALUATION_BATCH):
            inputs, maps = part.inputs.to(device), part.maps.to(device)
            predicted.append(base("novice", inputs, maps)[0].cpu())
    return Windows(copy.inputs, copy.targets - torch.cat(predicted), copy.maps)


def correction_units(datasets: Datasets) -> Standardisation:
    """Units of a correction, which starts at zero: the expert's, targets of mean 0."""
    units = Standardisation.fit(expert_of(datasets))
    return units._replace(target_mean=torch.zeros_like(units.target_mean))
