"""Pretraining: expert data in the novice's place, and the novice's start."""

import pytest
import torch

from ownrobot.methods.fine_tuning import (
    Pretrained,
    pretrained_from,
    pretraining_datasets,
    read,
    write,
)
from sidm.config import ConfigError
from sidm.learning import Training, train
from sidm.learning.checkpoint import CheckpointError
from sidm.learning.trainer import Trainer

ALONE = Training(
    p_expert=0.0,
    regularise=False,
    max_samples=2000,
    test_interval=5,
    prediction_iterations=10,
    batch=4,
)


@pytest.fixture
def start(datasets, small_network) -> Pretrained:
    return pretrained_from(
        train(pretraining_datasets(datasets, 0), small_network, ALONE, 0)
    )


def test_the_expert_stands_in_the_novices_place(datasets):
    """All expert data are used, three of four trajectories for training.

    There is no validation: no one looks at it.
    """
    sets = pretraining_datasets(datasets, 3)
    assert len(sets.train) + len(sets.test) == len(datasets.expert)
    assert len(sets.test) == round(len(datasets.expert) / 4)
    assert not set(sets.train.row_indices.tolist()) & set(
        sets.test.row_indices.tolist()
    )
    assert sets.train.stored_inputs is datasets.expert.inputs
    assert len(sets.validation) == 0
    with pytest.raises(ConfigError, match="pretraining needs the expert's data"):
        pretraining_datasets(datasets._replace(expert=None), 0)


def test_a_novice_goes_on_from_the_experts_weights(datasets, small_network, start):
    """The first test is that of the pretrained model, not of fresh weights."""
    trainer = Trainer(datasets, small_network, ALONE, 0, start=start.weights)
    fresh = Trainer(datasets, small_network, ALONE, 0)
    for name, tensor in trainer.weights().items():
        assert torch.equal(tensor, start.weights[name])
    assert trainer.run_test().test_loss < fresh.run_test().test_loss
    assert start.samples >= ALONE.max_samples


def test_kept_weights_come_back_and_damage_is_named(start, tmp_path):
    (tmp_path / "state").mkdir()
    write(tmp_path, start)
    stored = read(tmp_path)
    assert stored.samples == start.samples and list(stored.weights) == list(
        start.weights
    )
    assert all(
        torch.equal(stored.weights[name], tensor)
        for name, tensor in start.weights.items()
    )
    assert not (tmp_path / "state").exists() and read(tmp_path / "none") is None
    path = tmp_path / "checkpoint.npz"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(
        CheckpointError, match=r"checkpoint\.npz: the checkpoint is damaged"
    ):
        read(tmp_path)


def test_a_checkpoint_is_of_one_start(datasets, small_network, start, tmp_path):
    """A run from other weights does not resume from it."""
    train(datasets, small_network, ALONE, 0, checkpoint=tmp_path, start=start.weights)
    with pytest.raises(CheckpointError, match="of another run"):
        train(datasets, small_network, ALONE, 0, checkpoint=tmp_path)
