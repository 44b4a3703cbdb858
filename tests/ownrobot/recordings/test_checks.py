"""Wrong frames, signs and units in recordings like those of a real drive."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ownrobot.recordings import RecordingError, read_drives
from ownrobot.recordings.frames import (
    refuse_other_steering,
    refuse_other_turning,
    refuse_other_velocities,
)
from sidm.body import ROVER
from sidm.config import replace
from sidm.drives import Drive

ROOT = Path(__file__).parents[3]
#: indices in the state: wx, wy, wz; vy, vz, wy, wz
RATES, LEFT_AND_UP = slice(10, 13), [8, 9, 11, 12]


@pytest.fixture(scope="module", params=["system1", "system2"])
def drives(request) -> list[Drive]:
    """Every stored recording of a system; none may be refused."""
    return read_drives(ROOT / "recordings" / f"{request.param}.npz", ROVER)


def scaled(*factors: float):
    """Function that multiplies the three angular velocities."""
    return lambda states: _put(states, states[:, RATES] * factors)


def _put(states: np.ndarray, rates: np.ndarray) -> np.ndarray:
    states = states.copy()
    states[:, RATES] = rates
    return states


def _down(states: np.ndarray) -> np.ndarray:
    states = states.copy()
    states[:, LEFT_AND_UP] *= -1
    return states


DEGREES = np.degrees(1)
CHANGES = {
    "as (-wx, -wy, -wz)": scaled(-1, -1, -1),
    "as (-wx, wy, wz)": scaled(-1, 1, 1),
    "as (wx, -wy, wz)": scaled(1, -1, 1),
    "as (wx, wy, -wz)": scaled(1, 1, -1),
    "as (wy, wx, wz)": lambda states: _put(states, states[:, [11, 10, 12]]),
    "the world's frame": lambda states: _put(
        states, Rotation.from_quat(states[:, 3:7]).apply(states[:, RATES])
    ),
    "as (wx, -wy, -wz)": _down,
    "by 'wx'; is it in the unit": scaled(DEGREES, 1, 1),
    "by 'wy'; is it in the unit": scaled(1, DEGREES, 1),
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
    """Short drives of one file name the fault together.

    At least three of four longer drives are refused even alone: a level or straight one
    looks nearly the same either way.
    """
    changed = [CHANGES[fault](drive.states[:15]) for drive in drives]
    together = fault_of(*changed)
    assert fault in together or "lead where" in together
    messages = [fault_of(CHANGES[fault](drive.states)) for drive in drives]
    assert np.mean([bool(message) for message in messages]) > 0.75
    assert all(
        words.startswith("drive: ") and "\n" not in words for words in messages if words
    )


def test_short_drives_are_not_refused(drives):
    """Two seconds alone say too little; all of a file agree with their attitudes."""
    short = [drive.states[start : start + 21] for drive in drives for start in (0, 30)]
    assert [fault_of(states) for states in short] == [""] * len(short)
    assert fault_of(*short) == ""


def test_attitudes_that_are_inverted_are_not_taken(drives):
    """The message does not blame the robot's gyroscope."""
    said = [
        fault_of(np.hstack([d.states[:, :3], -d.states[:, 3:6], d.states[:, 6:]]))
        for d in drives
    ]
    assert np.mean(["lead where" in words for words in said]) > 0.9


def turning(
    rate: float,
    yaw_rate: float,
    shaking: float = 0.0,
    hertz: float = 7.0,
    seconds: float = 7.0,
) -> np.ndarray:
    """States (R, 13) of a robot that turns at 1 m/s and shakes about its sideways axis.

    The shaking has an amplitude in rad.
    """
    time = np.arange(round(rate * seconds) + 1) / rate
    yaw, pitch = yaw_rate * time, shaking * np.sin(2 * np.pi * hertz * time)
    attitudes = Rotation.from_euler("ZY", np.stack([yaw, pitch], axis=1))
    states = np.zeros((len(time), 13))
    states[:, :2] = (
        np.cumsum(np.stack([np.cos(yaw), np.sin(yaw)], axis=1), axis=0) / rate
    )
    states[:, 3:7], states[:, 7] = attitudes.as_quat(), 1.0
    about = np.stack([-np.sin(pitch), 0 * pitch, np.cos(pitch)], axis=1) * yaw_rate
    about[:, 1] = shaking * 2 * np.pi * hertz * np.cos(2 * np.pi * hertz * time)
    states[:, RATES] = about
    return states


@pytest.mark.parametrize("rate", [10.0, 100.0])
@pytest.mark.parametrize("hertz", [3.0, 6.3, 7.0, 8.1, 12.0])
def test_a_robot_that_shakes_is_taken(rate, hertz):
    """Shaking by a degree may be faster than half the rate of control steps.

    A sine that is sampled so slowly has the other sign.
    """
    for yaw_rate in (0.0, 0.3):
        assert fault_of(turning(rate, yaw_rate, 0.0175, hertz), rate=rate) == ""


def test_noise_bias_and_standing_still_are_no_fault(drives):
    """Noise is in attitudes and angular velocities.

    A gyroscope's bias may be larger than a slow turn.
    """
    rng = np.random.default_rng(0)
    for drive in drives[:20]:
        noise = rng.normal(0, 0.1, (len(drive.states), 3))
        assert fault_of(_put(drive.states, drive.states[:, RATES] + noise)) == ""
        still = np.repeat(drive.states[:1], len(drive.states), axis=0)
        still[:, 7:] = 0
        shaken = Rotation.from_quat(still[:, 3:7]) * Rotation.from_rotvec(0.01 * noise)
        still[:, 3:7] = shaken.as_quat()
        assert fault_of(_put(still, noise)) == ""
    biased = turning(10.0, -0.01)
    assert fault_of(_put(biased, biased[:, RATES] + 0.03)) == ""


def test_steering_to_the_left_is_noticed_in_a_file(drives):
    """Twenty drives show the sign together, whatever the ground.

    A drive that goes straight or stands still is not judged.
    """
    refuse_other_steering("file", drives)
    for first in range(0, len(drives) - 19, 20):
        other = [
            replace(drive, actions=drive.actions * (1, -1))
            for drive in drives[first : first + 20]
        ]
        with pytest.raises(
            RecordingError,
            match="file: robots turn against their steering, .* positive to the right",
        ):
            refuse_other_steering("file", other)
    states, steering = turning(10.0, 0.03), np.full((70, 2), 0.05)
    refuse_other_steering("file", [replace(drives[0], states=states, actions=steering)])
    still = np.repeat(states[:1], len(states), axis=0) + np.random.default_rng(
        0
    ).normal(0, 1e-3, states.shape)
    refuse_other_steering(
        "file", [replace(drives[0], states=still, actions=6 * steering)]
    )
