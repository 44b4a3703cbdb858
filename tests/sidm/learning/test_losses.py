"""Equations (1) to (5) against hand computation."""

import math

import pytest
import torch

from sidm.learning import losses


def test_prediction_loss_is_the_squared_norm():
    target = torch.zeros(2, 3, 13)
    predicted = target.clone()
    predicted[0, 0, 0], predicted[0, 0, 12], predicted[1, 2, 5] = 3.0, 4.0, -2.0
    expected = [[25.0, 0.0, 0.0], [0.0, 0.0, 4.0]]
    assert losses.prediction_loss(predicted, target).tolist() == expected
    with pytest.raises(ValueError, match=r"\(2, 3, 13\) and target \(3, 13\)"):
        losses.prediction_loss(predicted, target[0])


def test_discriminator_and_matching_losses_from_probabilities():
    expert = torch.logit(torch.tensor([0.9, 0.5], dtype=torch.float64))
    novice = torch.logit(torch.tensor([0.2, 0.7], dtype=torch.float64))
    of_expert, of_novice = math.log(0.9 * 0.5) / 2, math.log(0.8 * 0.3) / 2
    both = losses.expected_discriminator_loss(expert, novice)
    assert float(both) == pytest.approx(-of_expert - of_novice)
    assert float(losses.one_sided_loss(expert)) == pytest.approx(-of_expert)
    one_sided = losses.one_sided_loss(novice_logits=novice)
    assert float(one_sided) == pytest.approx(-of_novice)
    matching = losses.expected_matching_loss(novice)
    assert float(matching) == pytest.approx(-math.log(0.2 * 0.7) / 2)


def test_losses_stay_finite_where_the_probability_rounds():
    far = torch.tensor([200.0])
    assert losses.discriminator_loss(-far, far).item() == pytest.approx(400.0)
    assert losses.matching_loss(-far).item() == pytest.approx(200.0)
