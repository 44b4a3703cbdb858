"""Motion by what a user calls it."""

import numpy as np
import pytest
import torch

from sidm.body import ROVER
from sidm.config import ConfigError
from sidm.experiments.studies.own_data import as_drive, learn, pieces_of
from sidm.learning import validation_loss
from sidm.recordings import read_drives, write_drives
from sidm.systems import SYSTEMS
from sidm.trajectory import STEPS, load


def test_a_simulated_robot_goes_by_its_name(data, tiny):
    """What is on disk is read, and is a recording like any other."""
    collection = tiny.datasets("system1")["expert"].collection
    pieces = pieces_of("system1 expert", 0.4, data)
    trajectories = load(data, collection, 4)
    assert pieces.states.shape == (4, STEPS + 1, 13) and len(pieces.grounds) == 2
    assert np.array_equal(pieces.states[3], trajectories[3].states)


def test_recordings_go_by_their_file(tmp_path, data, tiny):
    trajectories = load(data, tiny.datasets("system1")["novice"].collection, 3)
    some = [as_drive(trajectory, SYSTEMS["system1"]) for trajectory in trajectories]
    write_drives(tmp_path / "mine.npz", some, ROVER, "made up")
    pieces = pieces_of(str(tmp_path / "mine.npz"), 1.0, data)
    assert len(pieces.states) == len(read_drives(tmp_path / "mine.npz", ROVER)) == 3
    assert np.allclose(pieces.states, np.stack([t.states for t in trajectories]), atol=1e-6)


def test_a_file_may_be_the_expert_too(tmp_path, data, tiny, small_network, small_training):
    """What is learnt with it is another with another file; a run with the same file repeats."""
    trajectories = load(data, tiny.datasets("system1")["novice"].collection, 8)
    recordings = [as_drive(trajectory, SYSTEMS["system1"]) for trajectory in trajectories]
    for name, some in (("mine", recordings[:4]), ("other", recordings[4:6]), ("third", recordings[6:])):
        write_drives(tmp_path / f"{name}.npz", some, ROVER, "made up")
    mine, *experts = (
        pieces_of(str(tmp_path / f"{name}.npz"), 1.0, data).motion(small_network.pixels)
        for name in ("mine", "other", "third", "other")
    )
    parts, minutes = torch.tensor([0, 1, 2]), 3 * 6.4 / 60
    first, second, again = (
        learn(mine, parts, torch.tensor([3]), expert, minutes, small_network, small_training, 0) for expert in experts
    )
    for method in ("sidm", "novice_only", "pretrain_finetune"):
        assert first[method].history == again[method].history != second[method].history
        assert torch.isfinite(validation_loss(first[method].model, mine)).all()


def test_what_is_neither_is_named(data):
    with pytest.raises(ConfigError, match="'system1 exprt' is no file .* did you mean 'system1 expert'?"):
        pieces_of("system1 exprt", 1.0, data)
