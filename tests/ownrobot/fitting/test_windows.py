"""Windows of recorded drives equal those of simulated drives of the same motion."""

import numpy as np
import pytest
import torch

from ownrobot.fitting.windows import common_length, cut, grounds_of, split_by_ground
from sidm.config import ConfigError, replace
from sidm.drives import STEPS, Drive, Ground
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


def short_drives(lengths):
    return [
        Drive(np.zeros((steps + 1, 13)), np.full((steps, 2), float(number)))
        for number, steps in enumerate(lengths)
    ]


@pytest.mark.parametrize(
    ("lengths", "steps"),
    [
        ([19] * 5, 19),
        ([500, 12], 64),  # 12 of 512 steps are 2 %
        ([100, 12], 12),  # 12 of 112 steps are 11 %
        ([40, 40, 30, 2], 30),  # 2 of 112 steps are 2 %, 32 are 29 %
        ([7], 7),
    ],
)
def test_short_drives_shorten_the_windows_only_if_they_are_many(lengths, steps):
    assert common_length(short_drives(lengths)) == steps


def test_windows_are_as_long_as_both_robots_allow():
    assert common_length(short_drives([50, 60]), short_drives([40])) == 40


def test_the_last_window_may_overlap_so_that_no_step_is_lost():
    drive = replace(
        short_drives([150])[0], actions=np.arange(300.0).reshape(150, 2) / 300
    )
    windows = cut([drive], 64, overlap=True)
    starts = [int(round(window.actions[0, 0] * 150)) for window in windows]
    assert starts == [0, 64, 86] and {len(window) for window in windows} == {64}
    assert len(cut([drive], 64)) == 2
    assert len(cut([drive], 75, overlap=True)) == 2  # no overlap is needed
