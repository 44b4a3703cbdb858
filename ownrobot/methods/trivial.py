"""Predictions that need no learning, as yardsticks: nothing changes, and the mean."""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor

from sidm.body import Body
from sidm.learning.dataset import Datasets
from sidm.learning.losses import prediction_loss
from sidm.learning.model import Predictor
from sidm.learning.networks import Memory
from sidm.learning.stopping import CurvePoint
from sidm.learning.training import Trained

Model = Literal["nothing_changes", "mean"]


class Trivial(Predictor):
    """Predicts transitions (B, T, Y) that are the same whatever the robot does.

    'nothing_changes': the robot stays where it is, and the columns keep their values;
    'mean': the mean transition of the training split, zero until `learn` sets it.
    """

    scale: Tensor | None

    def __init__(self, model: Model, body: Body, scale: Tensor | None = None):
        super().__init__()
        self.model, self.body = model, body
        self.register_buffer("scale", scale, persistent=False)
        transition = torch.zeros(len(body.targets))
        if model == "nothing_changes" and body.pose == "spatial":
            transition[body.pose_size - 1] = 1.0  # the quaternion of no rotation
        self.transition = torch.nn.Parameter(transition, requires_grad=False)

    def loss_weights(self, role: str) -> Tensor | None:
        """Weights (Y,) of the components in equation (1)."""
        return self.scale

    def forward(
        self, role: str, inputs: Tensor, maps: Tensor, memory: Memory | None = None
    ):
        """Transitions (B, T, Y) in raw units; `memory` is returned as it is."""
        predicted = self.transition.expand(*inputs.shape[:-1], -1)
        if self.model == "nothing_changes":
            pose, columns = self.body.pose_size, len(self.body.columns)
            end = inputs.shape[-1] - len(self.body.actions)
            kept = inputs[..., end - columns : end]
            predicted = torch.cat([predicted[..., :pose], kept], -1)
        return predicted, memory


def learn(
    datasets: Datasets, body: Body, model: Model, scale: Tensor | None = None
) -> Trained:
    """The trivial model, with the mean of the training split if it needs it."""
    trivial = Trivial(model, body, scale)
    train, test = datasets.train, datasets.test
    if model == "mean":
        trivial.transition.copy_(train.targets.mean((0, 1)))
    train_loss, test_loss = (
        float(
            prediction_loss(
                trivial("novice", part.inputs, part.maps)[0], part.targets, scale
            ).mean()
        )
        for part in (train, test)
    )
    steps = train.targets[..., 0].numel()
    curve = [CurvePoint(steps, train_loss, test_loss, None)]
    return Trained(trivial.eval(), curve, steps, 0, test_loss, steps, True)
