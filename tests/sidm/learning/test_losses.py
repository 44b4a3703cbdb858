"""Equations (1) to (5) against hand computation."""

import math

import pytest
import torch

from sidm.learning import losses


def test_prediction_loss_is_the_squared_norm():
    target = torch.zeros(2, 3, 13)
    predicted = target.clone()
    predicted[0, 0, 0], predicted[0, 0, 12], predicted[1, 2, 5] = 3.0, 4.0, -2.0
    assert losses.prediction_loss(predicted, target).tolist() == [
        [25.0, 0.0, 0.0],
        [0.0, 0.0, 4.0],
    ]


def test_components_sum_to_the_prediction_loss():
    predicted, target = torch.rand(
        2, 4, 5, 13, generator=torch.Generator().manual_seed(0)
    ).unbind()
    components = losses.component_losses(predicted, target)
    assert components.shape == (4, 5, 13)
    assert torch.equal(components.sum(-1), losses.prediction_loss(predicted, target))


def test_prediction_loss_refuses_unlike_shapes():
    with pytest.raises(ValueError, match=r"\(2, 13\) and target \(3, 13\)"):
        losses.prediction_loss(torch.zeros(2, 13), torch.zeros(3, 13))


def test_discriminator_loss_from_probabilities():
    expert = torch.tensor([0.9, 0.5], dtype=torch.float64)
    novice = torch.tensor([0.2, 0.5], dtype=torch.float64)
    loss = losses.discriminator_loss(torch.logit(expert), torch.logit(novice))
    expected = [-math.log(0.9) - math.log(0.8), 2 * math.log(2)]
    assert loss.tolist() == pytest.approx(expected)
    mean = losses.expected_discriminator_loss(torch.logit(expert), torch.logit(novice))
    assert float(mean) == pytest.approx(sum(expected) / 2)


def test_matching_loss_from_probabilities():
    novice = torch.tensor([0.2, 0.7], dtype=torch.float64)
    assert losses.matching_loss(torch.logit(novice)).tolist() == pytest.approx(
        [-math.log(0.2), -math.log(0.7)]
    )
    expected = -(math.log(0.2) + math.log(0.7)) / 2
    assert float(losses.expected_matching_loss(torch.logit(novice))) == pytest.approx(
        expected
    )


def test_losses_stay_finite_where_the_probability_rounds():
    far = torch.tensor([200.0])
    assert losses.discriminator_loss(-far, far).item() == pytest.approx(400.0)
    assert losses.matching_loss(-far).item() == pytest.approx(200.0)
