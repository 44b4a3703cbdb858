"""What models without a training loop have in common, and the two that learn nothing.

Nothing changes, and the mean, are yardsticks of the others.
"""

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

TrivialModel = Literal["nothing_changes", "mean"]


class ClosedForm(Predictor):
    """A predictor with fixed weights, of a loss with `scale` (Y,); None: all are 1."""

    scale: Tensor | None

    def __init__(self, scale: Tensor | None):
        super().__init__()
        self.register_buffer("scale", scale, persistent=False)

    def loss_weights(self, role: str) -> Tensor | None:
        """Weights (Y,) of the components in equation (1)."""
        return self.scale


def fitted(
    model: Predictor, steps: int, train_loss: float, test_loss: float
) -> Trained:
    """The model as a training that has seen so many steps once."""
    curve = [CurvePoint(steps, train_loss, test_loss, None)]
    return Trained(model.eval(), curve, steps, 0, test_loss, steps, True)


def weights_of(body: Body, scale: Tensor | None) -> Tensor:
    """Weights (Y,) of the components in equation (1), 1 by default."""
    return torch.ones(len(body.targets)) if scale is None else scale


def columns_and_actions(inputs: Tensor, body: Body) -> tuple[Tensor, Tensor]:
    """Columns (..., C) and actions (..., A) in inputs (..., X)."""
    end = inputs.shape[-1] - len(body.actions)
    return inputs[..., end - len(body.columns) : end], inputs[..., end:]


class Trivial(ClosedForm):
    """Predicts transitions (B, T, Y) that are the same whatever the robot does.

    'nothing_changes': the robot stays where it is, and the columns keep their values;
    'mean': the mean transition of the training split, zero until `learn` sets it.
    """

    def __init__(self, model: TrivialModel, body: Body, scale: Tensor | None = None):
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


def learn_trivial(
    datasets: Datasets, body: Body, model: TrivialModel, scale: Tensor | None = None
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
