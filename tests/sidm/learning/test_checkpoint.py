"""A run resumes bit for bit; unusable checkpoints are named."""

import dataclasses

import numpy as np
import pytest
import torch

from sidm.learning import CheckpointError, train
from sidm.learning.checkpoint import FILE, read, write


class Killed(Exception):
    """Stands for the end of a process."""


@pytest.fixture
def start(datasets, small_network, small_training, tmp_path):
    """Run four phases with a checkpoint.

    The test at `kill_at` samples raises an error.
    """

    def start(kill_at=None, seed=0, folder=tmp_path, **changes):
        def progress(tested):
            if kill_at is not None and tested.samples >= kill_at:
                raise Killed

        changes = {"max_samples": 24 * 24} | changes
        training = dataclasses.replace(small_training, **changes)
        how = dict(checkpoint=folder, progress=progress)
        return train(datasets, small_network, training, seed, **how)

    return start


def same(first, second):
    weights = second.model.state_dict()
    for name, one in first.model.state_dict().items():
        assert torch.equal(one, weights[name]), name
    assert first[1:] == second[1:]


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"p_expert": 0.0, "regularise": False},
        {
            "matching_optimiser": "shared",
            "decay": "l2",
            "weight_decay": 0.05,
            "zero_gradients": True,
            "replacement": False,
            "system_draw": "iteration",
        },
        {"matching": "reversal"},
        {"matching": "mmd", "frozen": "sidm"},
        {"mirror": True, "averaging": 0.9, "tether": 10.0},
    ],
)
def test_a_killed_run_goes_on_bit_for_bit_and_a_finished_one_is_read(
    start, tmp_path, changes
):
    whole = start(folder=None, **changes)
    for kill_at in (8 * 24, 20 * 24):
        with pytest.raises(Killed):
            start(kill_at=kill_at, **changes)
        assert (tmp_path / FILE).exists()
    same(start(**changes), whole)
    same(start(kill_at=0, **changes), whole)  # a further test would raise an error


def test_a_checkpoint_of_another_run_is_refused(start, datasets):
    start()
    for changes in ({"seed": 1}, {"learning_rate": 2e-3}):
        with pytest.raises(CheckpointError, match="of another run; delete it") as error:
            start(**changes)
        assert "\n" not in str(error.value)
    datasets.train.inputs[0, 0, 0] += 1
    with pytest.raises(CheckpointError, match="of another run"):
        start()


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\x03\x04 cut short"])
def test_a_damaged_checkpoint_is_named(start, tmp_path, content):
    (tmp_path / FILE).write_bytes(content)
    with pytest.raises(CheckpointError, match=f"{FILE}.*damaged.*delete it") as error:
        start()
    assert "\n" not in str(error.value)


def test_tensors_and_values_come_back_and_nothing_is_pickled(tmp_path):
    tensors = {"a/b": torch.tensor([1.5, float("inf")]), "step": torch.tensor(3.0)}
    values = {"loss": 0.1 + 0.2, "none": None, "list": [1, 2]}
    write(tmp_path, tensors, values)
    state, text = read(tmp_path)
    assert text == values
    assert all(torch.equal(state[name], tensor) for name, tensor in tensors.items())
    with np.load(tmp_path / FILE, allow_pickle=False) as data:
        assert all(data[name].dtype != object for name in data.files)
    assert list(tmp_path.iterdir()) == [tmp_path / FILE]
