"""Frames, signs and units that are not what they should be, put into the recordings of a real drive's kind."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sidm.recordings import Recording, RecordingError, read_recordings
from sidm.recordings.frames import refuse_other_rates, refuse_other_steering, refuse_other_velocities

ROOT = Path(__file__).parents[2]
RATES, LEFT_AND_UP = slice(10, 13), [8, 9, 11, 12]  # of the state: wx, wy, wz; vy, vz, wy, wz


@pytest.fixture(scope="module", params=["system1", "system2"])
def drives(request) -> list[Recording]:
    """Every recording of a system that is kept here; reading them is itself a test that none is refused."""
    return read_recordings(ROOT / "recordings" / f"{request.param}.npz")


def scaled(*factors: float):
    """A change of the three angular velocities."""
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
    "of the other sign": scaled(-1, -1, -1),
    "'wx' of the other sign": scaled(-1, 1, 1),
    "'wy' of the other sign": scaled(1, -1, 1),
    "'wz' of the other sign": scaled(1, 1, -1),
    "'wx' and 'wy' exchanged": lambda states: _put(states, states[:, [11, 10, 12]]),
    "the world's frame": lambda states: _put(states, Rotation.from_quat(states[:, 3:7]).apply(states[:, RATES])),
    "x forward, y right, z down": _down,
    "by 'wx'; is it in the unit": scaled(DEGREES, 1, 1),
    "by 'wy'; is it in the unit": scaled(1, DEGREES, 1),
    "by 'wz'; is it in the unit": scaled(1, 1, DEGREES),
}


def fault_of(states: np.ndarray) -> str:
    """What is said of the velocities, nothing where they are taken."""
    try:
        refuse_other_rates("drive", states)
        refuse_other_velocities("drive", states)
    except RecordingError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("fault", CHANGES)
def test_angular_velocities_that_are_read_wrongly_are_named(drives, fault):
    """In 19 of 20 drives by their right name; a level or straight one may look the same either way."""
    said = [fault_of(CHANGES[fault](drive.states)) for drive in drives]
    assert np.mean([fault in words for words in said]) > 0.95
    assert all(words.startswith("drive: ") and "\n" not in words for words in said if words)


def test_noise_and_standing_still_are_no_fault(drives):
    rng = np.random.default_rng(0)
    for drive in drives[:20]:
        noise = rng.normal(0, 0.2, (len(drive.states), 3))
        assert fault_of(_put(drive.states, drive.states[:, RATES] + noise)) == ""
        still = np.repeat(drive.states[:1], len(drive.states), axis=0)
        still[:, 7:] = 0
        assert fault_of(_put(still, noise)) == ""


def test_steering_to_the_left_is_noticed_in_a_file(drives):
    """Not in every drive, for ground turns a robot too and none is judged backwards, but among ten there is one."""
    refused = 0
    for drive in drives:
        refuse_other_steering("drive", drive.states, drive.actions)
        try:
            refuse_other_steering("drive", drive.states, drive.actions * (1, -1))
        except RecordingError as error:
            assert "turns against its steering" in str(error)
            refused += 1
    assert refused > 0.25 * len(drives)
