"""The losses of the paper, equations (1) to (5).

The discriminator's losses are computed from its logits s, A = sigmoid(s), because -log A(x) = softplus(-s) stays finite
where A itself rounds to 0 or 1.
"""

from __future__ import annotations

import torch.nn.functional as F
from torch import Tensor


def prediction_loss(predicted: Tensor, target: Tensor) -> Tensor:
    """Equation (1): squared 2-norm of y' - y.

    Args:
        predicted: (..., 13), raw units, the quaternion as the decoder gives it.
        target: (..., 13), raw units, the quaternion with w >= 0.

    Returns:
        (...), one loss a sample.

    Raises:
        ValueError: the shapes differ.
    """
    return component_losses(predicted, target).sum(-1)


def component_losses(predicted: Tensor, target: Tensor) -> Tensor:
    """The terms (..., 13) of the sum of equation (1)."""
    if predicted.shape != target.shape:
        raise ValueError(f"predicted {tuple(predicted.shape)} and target {tuple(target.shape)} must have one shape")
    return (predicted - target).square()


def discriminator_loss(expert_logits: Tensor, novice_logits: Tensor) -> Tensor:
    """Equation (3): -log A(x_e) - log(1 - A(x_n)), from logits of equal shape (...)."""
    return F.softplus(-expert_logits) + F.softplus(novice_logits)


def matching_loss(novice_logits: Tensor) -> Tensor:
    """Equation (5): -log A(x_n), from logits (...)."""
    return F.softplus(-novice_logits)


def expected_discriminator_loss(expert_logits: Tensor, novice_logits: Tensor) -> Tensor:
    """The expectation of equation (2), estimated by the mean over a batch: a scalar."""
    return discriminator_loss(expert_logits, novice_logits).mean()


def expected_matching_loss(novice_logits: Tensor) -> Tensor:
    """The expectation of equation (4), estimated by the mean over a batch: a scalar."""
    return matching_loss(novice_logits).mean()
