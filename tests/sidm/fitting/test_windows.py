"""Windows of recorded drives equal those of simulated drives of the same motion."""

import numpy as np
import pytest
import torch

from sidm.config import ConfigError, replace
from sidm.drives import STEPS, Ground
from sidm.fitting.windows import cut, grounds_of, split_by_ground
from sidm.learning import windows_of
from sidm.terrain import generate_terrain


def recorded(drive, ground):
    """A simulated drive in the form of a recording."""
    return replace(
        drive,
        states=drive.states.astype(float),
        actions=drive.actions.astype(float),
        ground=ground,
    )


@pytest.fixture
def recordings(make_trajectories, small_terrain):
    """Five drives of two windows and a rest each, over three grounds."""
    drives = make_trajectories(5, steps=2 * STEPS + 10)
    heights = [generate_terrain(small_terrain, drive.index // 2) for drive in drives]
    return [
        recorded(drive, Ground(one, small_terrain.spacing))
        for drive, one in zip(drives, heights, strict=True)
    ]


def test_windows_are_those_that_a_simulated_robot_would_have(
    make_trajectories, small_terrain
):
    drives = make_trajectories(3, steps=STEPS)
    some = [
        recorded(drive, Ground(drive.ground.heights, small_terrain.spacing))
        for drive in drives
    ]
    from_trajectories, from_drives = windows_of(cut(some), 8), windows_of(drives, 8)
    assert torch.allclose(
        from_trajectories.inputs, from_drives.inputs, atol=1e-6
    )  # float32
    assert torch.allclose(from_trajectories.targets, from_drives.targets, atol=1e-6)
    assert torch.allclose(
        from_trajectories.maps.float(), from_drives.maps.float(), atol=2e-3
    )  # float16


def test_recordings_are_cut_and_share_their_grounds(recordings):
    windows = cut(recordings)
    assert [(window.states.shape, window.actions.shape) for window in windows] == [
        ((STEPS + 1, 13), (STEPS, 2))
    ] * 10
    assert grounds_of(windows).tolist() == [0, 0, 0, 0, 1, 1, 1, 1, 2, 2]
    assert np.array_equal(
        windows[3].states, recordings[1].states[STEPS : 2 * STEPS + 1]
    )


def test_grounds_held_out_are_not_learnt_on(recordings):
    windows = cut(recordings)
    learning, judging = split_by_ground(windows, 1)
    assert learning.tolist() == list(range(8)) and judging.tolist() == [8, 9]
    with pytest.raises(ValueError, match="from 1 to 2 of 3 grounds, not 3"):
        split_by_ground(windows, 3)


def test_drives_that_are_too_short_are_refused(recordings):
    for drives in ([], cut(recordings, 20)):
        with pytest.raises(ConfigError, match="no drive of .* has 64 steps"):
            cut(drives)
