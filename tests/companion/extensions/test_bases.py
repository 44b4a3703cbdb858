"""A novice that goes on from the expert's weights, or corrects the expert's model."""

import pytest
import torch

from companion.extensions.residual import Corrected, correction_units, residual_datasets
from ownrobot.methods.fine_tuning import (
    Pretrained,
    pretrained_from,
    pretraining_datasets,
    read,
    write,
)
from sidm.config import ConfigError
from sidm.learning import DynamicsModel, Training, train
from sidm.learning.evaluation import mean_loss
from sidm.learning.trainer import Trainer
from sidm.learning.training import Trained

ALONE = Training(
    p_expert=0.0,
    regularise=False,
    max_samples=2000,
    test_interval=10,
    prediction_iterations=10,
    batch=4,
)


@pytest.fixture
def pretraining(datasets, small_network) -> Trained:
    return train(pretraining_datasets(datasets, 0), small_network, ALONE, 0)


@pytest.fixture
def base(pretraining) -> DynamicsModel:
    return pretraining.model.requires_grad_(False)


@pytest.fixture
def start(pretraining) -> Pretrained:
    return pretrained_from(pretraining)


def test_the_expert_stands_in_the_novices_place(datasets):
    """Three of four trajectories are for training; nothing looks at a validation."""
    sets = pretraining_datasets(datasets, 3)
    train_rows, test_rows = (set(part.row_indices.tolist()) for part in sets[:2])
    assert train_rows | test_rows == set(range(len(datasets.expert)))
    assert len(sets.test) == round(len(datasets.expert) / 4)
    assert not train_rows & test_rows and len(sets.validation) == 0
    assert sets.train.stored_inputs is datasets.expert.inputs
    for missing in (pretraining_datasets, lambda sets, _: correction_units(sets)):
        with pytest.raises(ConfigError, match="needs the expert's data"):
            missing(datasets._replace(expert=None), 0)


def test_a_novice_goes_on_from_the_experts_weights(datasets, small_network, start):
    """The first test is that of the pretrained model, not of fresh weights."""
    trainer = Trainer(datasets, small_network, ALONE, 0, start=start.weights)
    fresh = Trainer(datasets, small_network, ALONE, 0)
    for name, tensor in trainer.weights().items():
        assert torch.equal(tensor, start.weights[name])
    assert trainer.run_test().test_loss < fresh.run_test().test_loss


def test_kept_weights_come_back(start, tmp_path):
    (tmp_path / "state").mkdir()
    write(tmp_path, start)
    stored = read(tmp_path)
    assert stored.samples == start.samples >= ALONE.max_samples
    assert stored.weights.keys() == start.weights.keys()
    assert all(torch.equal(stored.weights[n], t) for n, t in start.weights.items())
    assert not (tmp_path / "state").exists() and read(tmp_path / "none") is None


def test_the_loss_of_a_correction_is_that_of_the_sum(datasets, base, small_network):
    """So the training loop, which sees only residuals, stops by the reported loss."""
    sets = residual_datasets(datasets, base)
    predicted, _ = base("novice", datasets.train.inputs, datasets.train.maps)
    whole = sets.train.targets + predicted
    assert torch.allclose(whole, datasets.train.targets, atol=1e-6)
    units = correction_units(sets)
    assert torch.equal(units.target_mean, torch.zeros(13))
    correction = train(sets, small_network, ALONE, 0, standardisation=units).model
    both = Corrected(base, correction)
    loss = mean_loss(correction, sets.test)
    assert mean_loss(both, datasets.test) == pytest.approx(loss, rel=1e-5)
    losses = [mean_loss(model, datasets.train) for model in (both, base)]
    assert losses[0] < losses[1]


def test_both_memories_are_carried_along(datasets, base, small_network):
    both = Corrected(base, DynamicsModel(small_network, seed=5, roles=["novice"]))
    inputs, maps = datasets.test.inputs, datasets.test.maps
    whole, _ = both("novice", inputs, maps)
    memory, steps = None, []
    for now in torch.arange(inputs.shape[1]).split(1):
        predicted, memory = both("novice", inputs[:, now], maps[:, now], memory)
        steps.append(predicted)
    assert torch.allclose(torch.cat(steps, 1), whole, atol=1e-5)
