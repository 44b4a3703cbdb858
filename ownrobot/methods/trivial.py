"""Predictions that need no learning, as yardsticks: nothing changes, and the mean."""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor

from ownrobot.methods.closed_form import ClosedForm, columns_and_actions, fitted
from sidm.body import Body
from sidm.learning.dataset import Datasets
from sidm.learning.losses import prediction_loss
from sidm.learning.networks import Memory
from sidm.learning.training import Trained

Model = Literal["nothing_changes", "mean"]


class Trivial(ClosedForm):
    """Predicts transitions (B, T, Y) that are the same whatever the robot does.

    'nothing_changes': the robot stays where it is, and the columns keep their values;
    'mean': the mean transition of the training split, zero until `learn` sets it.
    """

    def __init__(self, model: Model, body: Body, scale: Tensor | None = None):
        super().__init__(scale)
        self.model, self.body = model, body
        transition = torch.zeros(len(body.targets))
        if model == "nothing_changes" and body.pose == "spatial":
            transition[body.pose_size - 1] = 1.0  # the quaternion of no rotation
        self.transition = torch.nn.Parameter(transition, requires_grad=False)

    def forward(
        self, role: str, inputs: Tensor, maps: Tensor, memory: Memory | None = None
    ):
        """Transitions (B, T, Y) in raw units; `memory` is returned as it is."""
        predicted = self.transition.expand(*inputs.shape[:-1], -1)
        if self.model == "nothing_changes":
            kept, _ = columns_and_actions(inputs, self.body)
            pose = predicted[..., : self.body.pose_size]
            predicted = torch.cat([pose, kept], -1)
        return predicted, memory


def learn(
    datasets: Datasets, body: Body, model: Model, scale: Tensor | None = None
) -> Trained:
    """The trivial model, with the mean of the training split if it needs it."""
    trivial = Trivial(model, body, scale)
    train, test = datasets.train, datasets.test
    if model == "mean":
        trivial.transition.copy_(train.targets.mean((0, 1)))
    losses = []
    for part in (train, test):
        predicted, _ = trivial("novice", part.inputs, part.maps)
        losses.append(float(prediction_loss(predicted, part.targets, scale).mean()))
    steps = train.targets[..., 0].numel()
    return fitted(trivial, steps, *losses)
