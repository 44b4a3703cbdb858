"""Motion given as a user names it."""

import numpy as np
import pytest

from companion.pages.own_data import robot_drives
from ownrobot.recordings import write_drives
from sidm.body import ROVER
from sidm.config import ConfigError
from sidm.drives import STEPS


def test_a_simulated_robot_goes_by_its_name(tmp_path):
    """The robot is simulated, and its motion is a recording like any other."""
    drives = robot_drives("system1 expert", ROVER, 0.2, tmp_path)
    assert [drive.states.shape for drive in drives] == 2 * [(STEPS + 1, 13)]
    assert drives[0].ground is not None
    write_drives(tmp_path / "its.npz", drives, "simulated")
    back = robot_drives(str(tmp_path / "its.npz"), ROVER)
    assert np.allclose(
        [drive.states for drive in back], [drive.states for drive in drives], atol=1e-6
    )


def test_what_is_neither_is_named():
    with pytest.raises(
        ConfigError, match="'system1 exprt' is no file.* did you mean 'system1 expert'?"
    ):
        robot_drives("system1 exprt", ROVER)
