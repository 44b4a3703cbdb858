"""Recordings as tensors: the same as simulated trajectories of the same motion."""

import numpy as np
import pytest
import torch

from sidm.config import ConfigError
from sidm.fitting.windows import apart_by_ground, cut
from sidm.learning import prepare
from sidm.recordings import Drive, Ground
from sidm.terrain import generate_terrain
from sidm.trajectory import STEPS


@pytest.fixture
def recordings(make_trajectories, small_terrain):
    """Five drives of two pieces and a rest each, over three grounds."""
    found = []
    for one in make_trajectories(5, steps=2 * STEPS + 10):
        ground = Ground(generate_terrain(small_terrain, one.index // 2), small_terrain.spacing)
        found.append(Drive(f"drive {one.index}", "", one.states.astype(float), one.actions.astype(float), ground))
    return found


def test_pieces_are_those_that_a_simulated_robot_would_have(make_trajectories, small_terrain):
    """Inputs, targets and maps of `dataset.prepare`."""
    trajectories = make_trajectories(3, steps=STEPS)
    grounds = [Ground(generate_terrain(small_terrain, t.terrain_seed), small_terrain.spacing) for t in trajectories]
    some = [
        Drive("a", "", t.states.astype(float), t.actions.astype(float), ground)
        for t, ground in zip(trajectories, grounds, strict=True)
    ]
    ours, theirs = cut(some).motion(8), prepare(trajectories, small_terrain, 8)
    assert torch.allclose(ours.inputs, theirs.inputs, atol=1e-6)  # float32
    assert torch.allclose(ours.targets, theirs.targets, atol=1e-6)
    assert torch.allclose(ours.maps.float(), theirs.maps.float(), atol=2e-3)  # float16


def test_recordings_are_cut_and_share_their_grounds(recordings):
    pieces = cut(recordings)
    assert pieces.states.shape == (10, STEPS + 1, 13) and pieces.actions.shape == (10, STEPS, 2)
    assert pieces.ground.tolist() == [0, 0, 0, 0, 1, 1, 1, 1, 2, 2] and len(pieces.grounds) == 3
    assert np.array_equal(pieces.states[3], recordings[1].states[STEPS : 2 * STEPS + 1])


def test_grounds_held_out_are_not_learnt_on(recordings):
    pieces = cut(recordings)
    learning, judging = apart_by_ground(pieces, 1)
    assert learning.tolist() == list(range(8)) and judging.tolist() == [8, 9]
    with pytest.raises(ValueError, match="from 1 to 2 of 3 grounds, not 3"):
        apart_by_ground(pieces, 3)


def test_no_drives_are_refused():
    with pytest.raises(ConfigError, match="no drive has 64 steps"):
        cut([])
