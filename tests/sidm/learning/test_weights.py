"""Weights that the optimiser moves, and frozen weights."""

import pytest
import torch
from torch import nn

from sidm.learning import Training
from sidm.learning.training import prediction_phase
from sidm.learning.weights import make_optimiser, trainable_parameters


@pytest.fixture
def layer() -> nn.Linear:
    return nn.Linear(3, 2)


def test_a_frozen_sidm_stays_and_the_rest_learns(make_trainer):
    trainer = make_trainer(frozen="sidm", p_expert=0.5)
    before = trainer.weights()
    prediction_phase(trainer)
    for name, tensor in trainer.weights().items():
        kept = name.startswith("sidm") or "_mean" in name or "_std" in name
        assert torch.equal(tensor, before[name]) == kept, name
    assert not trainable_parameters(trainer.model.sidm)


def test_an_optimiser_has_what_is_not_frozen(layer):
    layer.bias.requires_grad_(False)
    optimiser = make_optimiser(layer, Training())
    assert [
        p is layer.weight for group in optimiser.param_groups for p in group["params"]
    ] == [True]
