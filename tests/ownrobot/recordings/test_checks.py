"""Wrong frames, signs and units in recordings like those of a real drive."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ownrobot.recordings import (
    RecordingError,
    RecordingWarning,
    read_drives,
    write_drives,
)
from ownrobot.recordings.frames import (
    refuse_other_steering,
    refuse_other_turning,
    refuse_other_velocities,
)
from ownrobot.recordings.headings import check_headings
from sidm.body import ROVER
from sidm.config import replace
from sidm.drives import Drive
from tests.ownrobot.cart import planar

ROOT = Path(__file__).parents[3]
RATES = slice(10, 13)  # of the state: wx, wy, wz


@pytest.fixture(scope="module", params=["system1", "system2"])
def drives(request) -> list[Drive]:
    return read_drives(ROOT / "recordings" / f"{request.param}.npz", ROVER)


def with_rates(states: np.ndarray, rates: np.ndarray) -> np.ndarray:
    return np.hstack([states[:, :10], rates])


def scaled(*factors: float):
    return lambda states: with_rates(states, states[:, RATES] * factors)


def in_world_frame(states: np.ndarray) -> np.ndarray:
    turned = Rotation.from_quat(states[:, 3:7]).apply(states[:, RATES])
    return with_rates(states, turned)


DEGREES = np.degrees(1)
CHANGES = {
    "as (-wx, -wy, -wz)": scaled(-1, -1, -1),
    "as (wx, wy, -wz)": scaled(1, 1, -1),
    "as (wy, wx, wz)": lambda states: with_rates(states, states[:, [11, 10, 12]]),
    "the world's frame": in_world_frame,
    # y is to the right and z down, of velocities too
    "as (wx, -wy, -wz)": lambda states: states * ([1.0] * 8 + [-1, -1, 1, -1, -1]),
    "inverted attitudes": lambda states: states * ([1.0] * 3 + [-1] * 3 + [1] * 7),
    "by 'wx'; is it in the unit": scaled(DEGREES, 1, 1),
    "by 'wz'; is it in the unit": scaled(1, 1, DEGREES),
}


def fault_of(*drives: np.ndarray, rate: float = 10.0) -> str:
    """Message about the velocities of a file, or nothing where they are accepted."""
    try:
        for states in drives:
            refuse_other_velocities("drive", states[:: round(rate / 10)], ROVER)
        refuse_other_turning("drive", [(states, rate) for states in drives])
    except RecordingError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("fault", CHANGES)
def test_angular_velocities_that_are_read_wrongly_are_named(drives, fault):
    """A level or straight drive looks nearly the same either way."""
    together = fault_of(*(CHANGES[fault](drive.states[:15]) for drive in drives))
    assert fault in together or "lead where" in together
    alone = [bool(fault_of(CHANGES[fault](drive.states))) for drive in drives]
    assert np.mean(alone) > 0.75


def turning(
    yaw_rate: float, rate: float = 10.0, shaking: float = 0.0, hertz: float = 7.0
) -> np.ndarray:
    """States of a robot that turns at 1 m/s and shakes about its y axis, rad."""
    time = np.arange(round(rate * 7) + 1) / rate
    yaw, pitch = yaw_rate * time, shaking * np.sin(2 * np.pi * hertz * time)
    attitudes = Rotation.from_euler("ZY", np.stack([yaw, pitch], axis=1))
    states = np.zeros((len(time), 13))
    ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    states[:, :2] = np.cumsum(ahead, axis=0) / rate
    states[:, 3:7], states[:, 7] = attitudes.as_quat(), 1.0
    about = np.stack([-np.sin(pitch), 0 * pitch, np.cos(pitch)], axis=1) * yaw_rate
    about[:, 1] = shaking * 2 * np.pi * hertz * np.cos(2 * np.pi * hertz * time)
    return with_rates(states, about)


@pytest.mark.parametrize("rate", [10.0, 100.0])
@pytest.mark.parametrize("hertz", [3.0, 6.3, 8.1, 12.0])
def test_a_robot_that_shakes_is_taken(rate, hertz):
    """A sine that is sampled too slowly has the other sign."""
    for yaw_rate in (0.0, 0.3):
        assert fault_of(turning(yaw_rate, rate, 0.0175, hertz), rate=rate) == ""


def test_short_drives_noise_bias_and_standing_still_are_no_fault(drives, rng):
    """A gyroscope's bias may be larger than a slow turn."""
    short = [drive.states[start : start + 21] for drive in drives for start in (0, 30)]
    assert fault_of(*short) == ""
    for drive in drives[:20]:
        noise = rng.normal(0, 0.1, (len(drive.states), 3))
        assert fault_of(with_rates(drive.states, drive.states[:, RATES] + noise)) == ""
        still = np.repeat(drive.states[:1], len(drive.states), axis=0)
        still[:, 7:] = 0
        shaken = Rotation.from_quat(still[:, 3:7]) * Rotation.from_rotvec(0.01 * noise)
        still[:, 3:7] = shaken.as_quat()
        assert fault_of(with_rates(still, noise)) == ""
    biased = turning(-0.01)
    assert fault_of(with_rates(biased, biased[:, RATES] + 0.03)) == ""


def test_steering_to_the_left_is_noticed_in_a_file(drives):
    """Twenty drives show it together; one that goes straight is not judged."""
    refuse_other_steering("file", drives)
    for first in range(0, len(drives) - 19, 20):
        some = drives[first : first + 20]
        other = [replace(drive, actions=drive.actions * (1, -1)) for drive in some]
        with pytest.raises(RecordingError, match="against their steering, .* right"):
            refuse_other_steering("file", other)
    states, steering = turning(0.03), np.full((70, 2), 0.05)
    refuse_other_steering("file", [replace(drives[0], states=states, actions=steering)])


RECORDINGS = ROOT / "recordings"
BODY = planar("cart", {"wheel": "rad/s"}, {"throttle": "1"})


def cart_drive(rng: np.random.Generator, off: float = 0.0, steps: int = 60) -> Drive:
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


@pytest.mark.parametrize("off", [75, 120, 180, -100])
def test_a_drive_of_several_that_is_off_is_found(rng, off):
    found = check_headings(
        [cart_drive(rng) for _ in range(11)] + [cart_drive(rng, off)], BODY
    )
    assert [one.drive for one in found.off] == [11] and not found.most
    assert abs((found.off[0].degrees - off + 180) % 360 - 180) < 15
    assert found.judged == 12


def test_right_drives_and_robots_that_slip_or_go_all_ways_are_not_found(rng):
    assert check_headings([cart_drive(rng) for _ in range(30)], BODY).off == []
    assert check_headings([cart_drive(rng)], BODY).off == []
    for most in (40, 180):
        drives = [cart_drive(rng, off) for off in rng.uniform(-most, most, 30)]
        assert check_headings(drives, BODY).off == []
    sideways = replace(BODY, columns=(("vy", "m/s"),))
    turned = [replace(cart_drive(rng, 90), body=sideways) for _ in range(5)]
    assert check_headings(turned, sideways).off == []


@pytest.mark.parametrize("count", [1, 8])
def test_a_file_of_drives_that_are_off_is_refused(rng, tmp_path, count):
    path = tmp_path / "drives.csv"
    write_drives(path, [cart_drive(rng, 90) for _ in range(count)], "a test")
    with pytest.raises(
        RecordingError,
        match=f"^{path}: {count} of {count} drives move [89][0-9] degrees off their "
        "yaw; are yaw, x and y of one frame, and is yaw 0 along x",
    ):
        read_drives(path, BODY)


#: Drives of the recordings in which the lidar's pose was matched wrongly -> degrees
#: between where the wheels should bring the robot and where it went. The positions
#: are smooth, the gyro agrees with the yaw, and no wheel slips sideways for 2 s.
KNOWN = {
    "warthog": {"22/0": 79, "65/2": -160},
    "husky": {"40/2": -72, "91/0": 72, "162/0": -155, "168/2": 72},
    "hunter": {},
}
COUNTS = {"warthog": 287, "husky": 480, "hunter": 80}


@pytest.mark.more
@pytest.mark.parametrize("robot", KNOWN)
def test_wrong_poses_in_the_recordings_are_told_and_can_be_left_out(robot, recwarn):
    body = RECORDINGS / ("hunter.yaml" if robot == "hunter" else "skid_steer.yaml")
    path = RECORDINGS / f"{robot}.csv.gz"
    drives = read_drives(path, body)
    assert len(drives) == COUNTS[robot]
    notes = [str(n.message) for n in recwarn if n.category is RecordingWarning]
    names = [f"drive {name} ({known} degrees)" for name, known in KNOWN[robot].items()]
    assert len(notes) == bool(names)
    for note in notes:
        assert f"do not move along their yaw: {', '.join(names)}; check" in note
    kept = read_drives(path, body, skip_bad=True)
    left_out = {one.name for one in drives} - {one.name for one in kept}
    assert left_out == {f"{path} drive {name}" for name in KNOWN[robot]}
