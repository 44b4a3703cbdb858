"""A run resumes bit for bit; unusable checkpoints are named."""

import dataclasses

import numpy as np
import pytest
import torch

from sidm.learning import CheckpointError, train
from sidm.learning.checkpoint import FILE, read, write
from sidm.learning.resuming import Checkpoint
from sidm.learning.trainer import Trainer


class Killed(Exception):
    """Stands for the end of a process."""


@pytest.fixture
def start(datasets, small_network, small_training, tmp_path):
    """Run four phases with a checkpoint.

    The test at `kill_at` samples raises an error.
    """

    def start(kill_at=None, seed=0, checkpoint=tmp_path, **changes):
        def progress(tested):
            if kill_at is not None and tested.samples >= kill_at:
                raise Killed

        training = dataclasses.replace(
            small_training, **({"max_samples": 24 * 24} | changes)
        )
        return train(
            datasets,
            small_network,
            training,
            seed,
            checkpoint=checkpoint,
            progress=progress,
        )

    return start


def same(first, second):
    for (name, one), other in zip(
        first.model.state_dict().items(),
        second.model.state_dict().values(),
        strict=True,
    ):
        assert torch.equal(one, other), name
    assert first[1:] == second[1:]


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"p_expert": 0.0, "regularise": False},
        {"matching_optimiser": "shared", "decay": "l2"},
        {"matching": "reversal"},
        {"matching": "mmd", "frozen": "sidm"},
        {"mirror": True, "averaging": 0.9, "tether": 10.0},
    ],
)
@pytest.mark.parametrize("kill_at", [8 * 24, 20 * 24])
def test_a_killed_run_goes_on_bit_for_bit(start, tmp_path, changes, kill_at):
    whole = start(checkpoint=None, **changes)
    with pytest.raises(Killed):
        start(kill_at=kill_at, **changes)
    assert (tmp_path / FILE).exists()
    same(start(**changes), whole)


def test_a_finished_run_is_read_not_repeated(start):
    first = start()
    same(start(kill_at=0), first)  # a further test would raise an error


def test_restored_state_is_the_saved_one(
    datasets, small_network, small_training, tmp_path
):
    trainer = Trainer(datasets, small_network, small_training, 0)
    Checkpoint(tmp_path).save(trainer)
    twin = Trainer(datasets, small_network, small_training, 0)
    assert Checkpoint(tmp_path).restore(twin)
    assert not Checkpoint(tmp_path / "elsewhere").restore(twin)
    assert twin.history == []
    assert twin.accuracy is None
    assert twin.stopping == trainer.stopping


@pytest.mark.parametrize("changes", [{"seed": 1}, {"learning_rate": 2e-3}])
def test_a_checkpoint_of_another_run_is_refused(start, changes):
    start()
    with pytest.raises(CheckpointError, match="of another run; delete it") as caught:
        start(**changes)
    assert "\n" not in str(caught.value)


def test_a_checkpoint_of_other_data_is_refused(start, datasets):
    start()
    datasets.train.inputs[0, 0, 0] += 1
    with pytest.raises(CheckpointError, match="of another run"):
        start()


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\x03\x04 cut short"])
def test_a_damaged_checkpoint_is_named(start, tmp_path, content):
    (tmp_path / FILE).write_bytes(content)
    with pytest.raises(CheckpointError, match="damaged.*delete it") as caught:
        start()
    assert "\n" not in str(caught.value) and FILE in str(caught.value)


def test_arrays_and_text_come_back(tmp_path):
    tensors = {
        "a/b": torch.tensor([1.5, float("inf")]),
        "step": torch.tensor(3.0),
        "bytes": torch.tensor([7]).byte(),
    }
    values = {"loss": 0.1 + 0.2, "none": None, "list": [1, 2]}
    write(tmp_path / "new", tensors, values)
    state, text = read(tmp_path / "new")
    assert text == values
    assert all(torch.equal(state[name], tensor) for name, tensor in tensors.items())
    assert state["step"].shape == ()


def test_nothing_is_pickled(start, tmp_path):
    start()
    with np.load(tmp_path / FILE, allow_pickle=False) as data:
        assert all(data[name].dtype != object for name in data.files)
    assert list(tmp_path.iterdir()) == [tmp_path / FILE]
