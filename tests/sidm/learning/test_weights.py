"""What follows an update: the pull to the start, the running average; what is frozen."""

import pytest
import torch
from torch import nn

from sidm.learning import Training
from sidm.learning.evaluation import mean_loss
from sidm.learning.training import predict_phase
from sidm.learning.weights import WARM_UP, Follower, learnt, make_optimiser


@pytest.fixture
def layer() -> nn.Linear:
    return nn.Linear(3, 2)


def test_the_pull_is_a_share_of_the_way_back(layer):
    follower = Follower(layer, Training(tether=10.0, learning_rate=0.01))
    before = layer.weight.detach().clone()
    layer.weight.data += 2.0
    follower.follow()
    assert torch.allclose(layer.weight, before + 2.0 * 0.9, atol=1e-6)


def test_without_either_nothing_follows(layer):
    follower = Follower(layer, Training())
    layer.weight.data += 2.0
    before = layer.weight.detach().clone()
    follower.follow()
    with follower.averaged():
        assert torch.equal(layer.weight, before)
    assert not follower.tensors()


def test_the_average_is_that_of_its_formula(layer):
    """Early it forgets faster: an average of n updates has no more of the past than n / (n + WARM_UP)."""
    follower, expected = Follower(layer, Training(averaging=0.9)), layer.weight.detach().clone()
    for number in range(1, 200):
        layer.weight.data += 0.1
        follower.follow()
        past = min(0.9, number / (number + WARM_UP))
        expected = past * expected + (1 - past) * layer.weight.detach()
    after = layer.weight.detach().clone()
    with follower.averaged():
        assert torch.allclose(layer.weight, expected, atol=1e-4)
        assert not torch.allclose(layer.weight, after, atol=0.1)
    assert torch.equal(layer.weight, after)


def test_tests_see_the_average_and_training_goes_on_without_it(make_learner):
    learner, plain = make_learner(averaging=0.5), make_learner()
    predict_phase(learner), predict_phase(plain)
    assert all(torch.equal(one, plain.weights()[name]) for name, one in learner.weights().items())
    learner.take_test()
    raw = mean_loss(learner.model, learner.test)
    with learner.follower.averaged():
        assert learner.history[-1].test_loss == mean_loss(learner.model, learner.test) != raw


def test_a_frozen_sidm_stays_and_the_rest_learns(make_learner):
    learner = make_learner(frozen="sidm", p_expert=0.5)
    before = learner.weights()
    predict_phase(learner)
    for name, tensor in learner.weights().items():
        kept = name.startswith("sidm") or "_mean" in name or "_std" in name
        assert torch.equal(tensor, before[name]) == kept, name
    assert not learnt(learner.model.sidm)


def test_an_optimiser_has_what_is_not_frozen(layer):
    layer.bias.requires_grad_(False)
    optimiser = make_optimiser(layer, Training())
    assert [p is layer.weight for group in optimiser.param_groups for p in group["params"]] == [True]
