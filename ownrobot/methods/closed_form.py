"""What models have in common that no training loop makes."""

from __future__ import annotations

import torch
from torch import Tensor

from sidm.body import Body
from sidm.learning.model import Predictor
from sidm.learning.stopping import CurvePoint
from sidm.learning.training import Trained


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
