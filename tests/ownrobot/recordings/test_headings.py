"""Drives whose motion is off their yaw, in recordings and in drives made for it."""

from pathlib import Path

import numpy as np
import pytest

from ownrobot.recordings import (
    RecordingError,
    RecordingWarning,
    read_drives,
    write_drives,
)
from ownrobot.recordings.headings import check_headings
from sidm.body import Body
from sidm.config import replace
from sidm.drives import Drive

ROOT = Path(__file__).parents[3] / "recordings"
BODY = Body(
    name="cart",
    pose="planar",
    columns=(("wheel", "rad/s"),),
    actions=(("throttle", "1"),),
)


def drive(rng: np.random.Generator, off: float = 0.0, steps: int = 60) -> Drive:
    """A cart that goes forwards and backwards in curves; its pose is `off` degrees."""
    time = np.arange(steps + 1) / BODY.rate
    phase = rng.uniform(0, 2 * np.pi)
    speed = 1.2 * np.sin(time + phase)
    yaw = 0.3 * np.sin(0.5 * time + phase)
    course = yaw + np.radians(off)
    moved = (speed * np.stack([np.cos(course), np.sin(course)]) / BODY.rate).T
    place = np.cumsum(moved, axis=0) + rng.normal(0, 0.005, (steps + 1, 2))
    wheel = -4 * speed + rng.normal(0, 0.2, steps + 1)  # turns backwards
    states = np.column_stack([place, yaw, wheel])
    throttle = np.sin(time[:-1] + phase + 0.2)[:, None]
    name = f"drive {phase:.6f}"
    return Drive(states, throttle, BODY, name=name, session=name)


@pytest.mark.parametrize("off", [75, 90, 120, 158, 180, -100])
def test_a_drive_of_several_that_is_off_is_found(rng, off):
    drives = [drive(rng) for _ in range(11)] + [drive(rng, off)]
    found = check_headings(drives, BODY)
    assert [one.drive for one in found.off] == [11] and not found.most
    difference = (found.off[0].degrees - off + 180) % 360 - 180
    assert abs(difference) < 15
    assert found.judged == 12


def test_right_drives_are_not_found(rng):
    for _ in range(5):
        assert check_headings([drive(rng) for _ in range(6)], BODY).off == []
        assert check_headings([drive(rng)], BODY).off == []


@pytest.mark.parametrize("count", [1, 8])
def test_a_file_of_drives_that_are_off_is_refused(rng, tmp_path, count):
    path = tmp_path / "drives.csv"
    write_drives(path, [drive(rng, 90) for _ in range(count)], "a test")
    with pytest.raises(
        RecordingError,
        match=f"^{path}: {count} of {count} drives move [89][0-9] degrees off their "
        "yaw; are yaw, x and y of one frame, and is yaw 0 along x",
    ):
        read_drives(path, BODY)


def test_a_robot_that_goes_in_all_directions_is_not_judged(rng):
    drives = [drive(rng, off) for off in rng.uniform(-180, 180, 30)]
    assert check_headings(drives, BODY).off == []
    sideways = Body(
        name="sideways",
        pose="planar",
        columns=(("vy", "m/s"),),
        actions=BODY.actions,
    )
    turned = [replace(drive(rng, 90), body=sideways) for _ in range(5)]
    assert check_headings(turned, sideways).off == []


def test_slipping_sideways_by_half_a_right_angle_is_no_fault(rng):
    drives = [drive(rng, off) for off in rng.uniform(-40, 40, 20)]
    assert check_headings(drives, BODY).off == []


#: Drives of the recordings in which the lidar's pose was matched wrongly -> degrees
#: between where the wheels should bring the robot and where it went. The positions
#: are smooth, the gyro agrees with the yaw, and no wheel slips sideways for 2 s.
KNOWN = {
    "warthog": {"22/0": 79, "65/2": -160},
    "husky": {"40/2": -72, "91/0": 72, "162/0": -155, "168/2": 72},
    "hunter": {},
}


@pytest.mark.more
@pytest.mark.parametrize("robot", KNOWN)
def test_wrong_poses_in_the_recordings_are_told_and_can_be_left_out(robot, recwarn):
    body = ROOT / ("hunter.yaml" if robot == "hunter" else "skid_steer.yaml")
    path = ROOT / f"{robot}.csv.gz"
    drives = read_drives(path, body)
    notes = [str(n.message) for n in recwarn if n.category is RecordingWarning]
    names = [f"drive {name} ({known} degrees)" for name, known in KNOWN[robot].items()]
    assert len(notes) == bool(names)
    for note in notes:
        assert note.startswith(f"{path}: {len(names)} of ")
        assert f"do not move along their yaw: {', '.join(names)}; check" in note
    recwarn.clear()
    kept = read_drives(path, body, skip_bad=True)
    left_out = {one.name for one in drives} - {one.name for one in kept}
    assert left_out == {f"{path} drive {name}" for name in KNOWN[robot]}
    assert all("left out: " in str(note.message) for note in recwarn)
