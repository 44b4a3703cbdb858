"""Motion given as a user names it, and the part of it that is held out."""

import numpy as np
import pytest

from companion.pages.own_data import robot_drives
from sidm.body import ROVER
from sidm.config import ConfigError
from sidm.drives import STEPS, Drive
from sidm.fitting.windows import hold_out
from sidm.recordings import write_drives


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


def drive(session: str, steps: int = 10) -> Drive:
    return Drive(np.zeros((steps + 1, 13)), np.zeros((steps, 2)), session=session)


@pytest.mark.parametrize(
    ("sessions", "share", "judging"),
    [
        ("aabbccdd", 0.25, "dd"),
        ("ddccbbaa", 0.6, "bbaa"),
        ("aabb", 0.01, "bb"),
        ("aabb", 1.0, "bb"),
        ("aaaa", 0.5, "aa"),
    ],
)
def test_a_session_judges_as_a_whole(sessions, share, judging):
    learning, held = hold_out([drive(name) for name in sessions], share)
    assert "".join(one.session for one in held) == judging
    assert len(learning) + len(held) == len(sessions)


def test_it_is_steps_that_are_shared_out():
    learning, held = hold_out([drive("a", 80), drive("b"), drive("c")], 0.2)
    assert [one.session for one in held] == ["b", "c"] and len(learning) == 1


def test_one_drive_cannot_judge_itself():
    with pytest.raises(ConfigError, match="a single drive leaves none to evaluate on"):
        hold_out([drive("a")], 0.3)
