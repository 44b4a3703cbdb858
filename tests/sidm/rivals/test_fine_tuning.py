"""Pretraining: its data in the novice's place, and what the novice starts from."""

import pytest
import torch

from sidm.config import ConfigError
from sidm.learning import Training, train
from sidm.learning.checkpoint import CheckpointError
from sidm.learning.trainer import Trainer
from sidm.rivals.fine_tuning import Start, expert_in_place, keep, read, start_from

ALONE = Training(
    p_expert=0.0,
    regularise=False,
    max_samples=2000,
    test_interval=5,
    prediction_iterations=10,
    batch=4,
)


@pytest.fixture
def start(datasets, small_network) -> Start:
    return start_from(train(expert_in_place(datasets, 0), small_network, ALONE, 0))


def test_the_expert_stands_in_the_novices_place(datasets):
    """All of it, three of four to learn from; what judges the novice stays."""
    sets = expert_in_place(datasets, 3)
    assert len(sets.train) + len(sets.test) == len(datasets.expert)
    assert len(sets.test) == round(len(datasets.expert) / 4)
    assert not set(sets.train.places.tolist()) & set(sets.test.places.tolist())
    assert (
        sets.train.stored_inputs is datasets.expert.inputs
        and sets.validation is sets.test
    )
    with pytest.raises(ConfigError, match="pretraining needs the expert's data"):
        expert_in_place(datasets._replace(expert=None), 0)


def test_a_novice_goes_on_from_the_experts_weights(datasets, small_network, start):
    """Its first test is that of the pretrained model, not that of fresh weights."""
    trainer = Trainer(datasets, small_network, ALONE, 0, start=start.weights)
    fresh = Trainer(datasets, small_network, ALONE, 0)
    for name, tensor in trainer.weights().items():
        assert torch.equal(tensor, start.weights[name])
    assert trainer.take_test().test_loss < fresh.take_test().test_loss
    assert start.samples >= ALONE.max_samples


def test_kept_weights_come_back_and_damage_is_named(start, tmp_path):
    (tmp_path / "state").mkdir()
    keep(tmp_path, start)
    found = read(tmp_path)
    assert found.samples == start.samples and list(found.weights) == list(start.weights)
    assert all(
        torch.equal(found.weights[name], tensor)
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
    """A run from other weights does not go on from it."""
    train(datasets, small_network, ALONE, 0, checkpoint=tmp_path, start=start.weights)
    with pytest.raises(CheckpointError, match="of another run"):
        train(datasets, small_network, ALONE, 0, checkpoint=tmp_path)
