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
    faults_together,
    refuse_other_turning,
    refuse_other_velocities,
)
from ownrobot.recordings.headings import drives_along_yaw
from ownrobot.recordings.table import Findings
from sidm.body import ROVER
from sidm.config import replace
from sidm.drives import Drive
from tests.ownrobot.cart import CART, planar

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
            refuse_other_velocities(states[:: round(rate / 10)], ROVER)
        refuse_other_turning([(states, rate) for states in drives])
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
    assert faults_together("file", drives, ROVER) == []
    for first in range(0, len(drives) - 19, 20):
        some = drives[first : first + 20]
        other = [replace(drive, actions=drive.actions * (1, -1)) for drive in some]
        (fault,) = faults_together("file", other, ROVER)
        assert fault.startswith("file: robots turn against their steering")
    straight = {"states": turning(0.03), "actions": np.full((70, 2), 0.05)}
    assert faults_together("file", [replace(drives[0], **straight)], ROVER) == []


RECORDINGS = ROOT / "recordings"
BODY = planar("cart", {"wheel": "rad/s"}, {"throttle": "1"})


def cart_drive(rng: np.random.Generator, off=0.0, facing=0.0, steps=60) -> Drive:
    """A cart that goes forwards and backwards in curves; its pose is `off` degrees."""
    time = np.arange(steps + 1) / BODY.rate
    phase = rng.uniform(0, 2 * np.pi)
    speed = 1.2 * np.sin(time + phase)
    yaw = facing + 0.3 * np.sin(0.5 * time + phase)
    course = yaw + np.radians(off)
    moved = (speed * np.stack([np.cos(course), np.sin(course)]) / BODY.rate).T
    place = np.cumsum(moved, axis=0) + rng.normal(0, 0.005, (steps + 1, 2))
    wheel = -4 * speed + rng.normal(0, 0.2, steps + 1)  # turns backwards
    states = np.column_stack([place, yaw, wheel])
    throttle = np.sin(time[:-1] + phase + 0.2)[:, None]
    name = f"drive {phase:.6f}"
    return Drive(states, throttle, BODY, name=name, session=name)


def said(drives: list[Drive]) -> list[str]:
    """What is said of drives of one file whose motion is off their yaw."""
    findings = Findings(skip=True, doubtful=True)
    with findings.kept("file"):
        assert drives_along_yaw("file", drives, drives[0].body, findings) == drives
    return findings.faults + findings.notes


@pytest.mark.parametrize("off", [75, 120, 180, -100])
def test_a_drive_of_several_that_is_off_is_found(rng, off):
    drives = [*(cart_drive(rng) for _ in range(11)), cart_drive(rng, off)]
    (note,) = said(drives)
    start = f"file: 1 of 12 drives do not move along their yaw: {drives[11].name} ("
    assert note.startswith(start)
    degrees = float(note.removeprefix(start).split()[0])
    assert abs((degrees - off + 180) % 360 - 180) < 15


def test_right_drives_and_robots_that_slip_or_go_all_ways_are_not_found(rng):
    assert said([cart_drive(rng) for _ in range(30)]) == []
    assert said([cart_drive(rng)]) == []
    for most, facing in ((40, 3), (180, 3)):
        spread = rng.uniform(-1, 1, (30, 2)) * (most, facing)
        assert said([cart_drive(rng, *one) for one in spread]) == []
    sideways = replace(BODY, columns=(("vy", "m/s"),))
    assert said([replace(cart_drive(rng, 90), body=sideways) for _ in range(5)]) == []


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


def weaving(yaw_of, steps=400, wide=2.0) -> Drive:
    """A drive in all directions, with a yaw that is a function of the true one."""
    yaw = wide * np.cumsum(np.sin(0.07 * np.arange(steps + 1))) / 10
    x, y = (np.cumsum(0.1 * part(yaw)) for part in (np.cos, np.sin))
    states = np.stack([x, y, yaw_of(yaw), np.ones(steps + 1)], 1)
    return Drive(states, np.ones((steps, 1)), CART)


@pytest.mark.parametrize(
    "yaw_of, words",
    [
        (lambda yaw: yaw, ""),
        (lambda yaw: yaw + np.pi, ""),  # it drives backwards
        (lambda yaw: yaw + 0.8, "45 degrees off"),
        (lambda yaw: -yaw, "turned to the right"),
        (lambda yaw: np.pi / 2 - yaw, "turned to the right"),  # a compass
        (lambda yaw: 0 * yaw, "hardly changes"),
        (lambda yaw: 1 + 0.02 * np.sin(30 * yaw), "hardly changes"),
        (np.degrees, "in degrees"),
        (lambda yaw: np.degrees(-yaw), ""),  # two faults at once are not told apart
        (np.radians, "called degrees"),
    ],
)
def test_the_yaw_of_all_drives_is_held_against_their_directions(yaw_of, words):
    faults = said([weaving(yaw_of)] * 3)
    assert words in "".join(faults) and bool(words) == bool(faults)


def test_what_tells_nothing_of_the_yaw_is_no_fault():
    assert said([weaving(lambda yaw: 0 * yaw, wide=0.02)]) == []


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
