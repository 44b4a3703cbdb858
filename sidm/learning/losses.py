"""The losses of the paper, equations (1) to (5).

The discriminator's losses are computed from its logits s, with A = sigmoid(s), because
-log A(x) = softplus(-s) stays finite where A itself rounds to 0 or 1.
"""

from __future__ import annotations

import torch.nn.functional as F
from torch import Tensor


def prediction_loss(
    predicted: Tensor, target: Tensor, weights: Tensor | None = None
) -> Tensor:
    """Equation (1): the squared 2-norm (...) of y' - y for each sample.

    Args:
        predicted: y' (..., Y), raw units, with the quaternion as the decoder gives it.
        target: y (..., Y), raw units, with a quaternion of w >= 0.
        weights: (Y,), factors of the components' squares; None: 1, as in the paper.
    """
    return component_losses(predicted, target, weights).sum(-1)


def component_losses(
    predicted: Tensor, target: Tensor, weights: Tensor | None = None
) -> Tensor:
    """The terms (..., Y) of the sum in equation (1), see `prediction_loss`."""
    if predicted.shape != target.shape:
        shapes = f"predicted {tuple(predicted.shape)} and target {tuple(target.shape)}"
        raise ValueError(f"{shapes} must have one shape")
    squares = (predicted - target).square()
    return squares if weights is None else squares * weights


def discriminator_loss(expert_logits: Tensor, novice_logits: Tensor) -> Tensor:
    """Equation (3): -log A(x_e) - log(1 - A(x_n)), from logits of equal shape (...)."""
    return F.softplus(-expert_logits) + F.softplus(novice_logits)


def matching_loss(novice_logits: Tensor) -> Tensor:
    """Equation (5): -log A(x_n), from logits (...)."""
    return F.softplus(-novice_logits)


def expected_discriminator_loss(expert_logits: Tensor, novice_logits: Tensor) -> Tensor:
    """The expectation of equation (2), estimated by the mean over a batch: a scalar."""
    return discriminator_loss(expert_logits, novice_logits).mean()


def one_sided_loss(
    expert_logits: Tensor | None = None, novice_logits: Tensor | None = None
) -> Tensor:
    """The mean term of equation (2) for a batch of the one system that is given."""
    if novice_logits is not None:
        return F.softplus(novice_logits).mean()
    assert expert_logits is not None
    return F.softplus(-expert_logits).mean()


def expected_matching_loss(novice_logits: Tensor) -> Tensor:
    """The expectation of equation (4), estimated by the mean over a batch: a scalar."""
    return matching_loss(novice_logits).mean()
