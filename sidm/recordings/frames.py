"""What tells that a recording's numbers are of another frame, sign, unit or map than they should be."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial.transform import Rotation  # attitudes as arrays; those of `sidm.rotations` are tensors

from sidm.recordings.recording import RATE, STATE, Ground, Recording, RecordingError
from sidm.terrain import height_at
from sidm.trajectory import POSITION, QUATERNION, TWIST

ABOVE = 2.0  # m, between a robot and the ground under it, more is taken for a map of other ground
FLIPPED = 0.25  # of how a robot moves up and down over its ground: so much less over another reading is taken for that
WINDOW = 10  # control steps over which velocities are held against what they lead to
MISFIT = 0.3  # of the way, between the two, more is taken for another frame or unit
LEAST_WAY, LEAST_TURN = 0.1, 0.3  # m and rad a window that are no misfit: noise, and shocks between two rows
TIMES = 20.0  # as much turning by its rates as by its attitudes, or as little, is taken for another unit
JUMP = 0.5  # m, in one control step beside what the velocity leads to
SHORTER = 0.5  # s, of the windows over which angular velocities are held against attitudes
LEAST_MISFIT = 0.15  # rad a window, of turning that angular velocities do not explain, for them to be doubted
BETTER = 0.7  # of it: what leaves less unexplained is taken for how they should be read
FORWARD, FEWEST_STEPS = 0.2, 30  # m/s, and steps of 0.1 s as fast, to judge steering by
LEAST_STEERED = 0.1  # m/s and rad/s, standard deviations of steering by speed and of turning
OTHER_WAY = 0.4  # correlation of the two: more is taken for the other sign, as it is negative

Reading = Callable[[np.ndarray, Rotation], np.ndarray]

#: Angular velocities (K, 3) that would be right if they were read so, with the attitudes; none changes their size.
READINGS: dict[str, Reading] = {
    "with the other sign": lambda rates, _: -rates,
    "as those of a frame with x forward, y right, z down": lambda rates, _: rates * (1, -1, -1),
    "as those of the world's frame": lambda rates, attitudes: attitudes.apply(rates, inverse=True),
    "with 'wx' and 'wy' exchanged": lambda rates, _: rates[:, (1, 0, 2)],
    "with 'wx' of the other sign": lambda rates, _: rates * (-1, 1, 1),
    "with 'wy' of the other sign": lambda rates, _: rates * (1, -1, 1),
    "with 'wz' of the other sign": lambda rates, _: rates * (1, 1, -1),
}


def refuse_other_maps(name: str, states: np.ndarray, ground: Ground) -> None:
    """RecordingError where states (K + 1, 13) leave the map, lie far above it, or fit another reading of it better."""
    half = [(size - 1) / 2 * ground.spacing for size in reversed(ground.heights.shape)]
    outside = np.flatnonzero((np.abs(states[:, :2]) > half).any(1))
    if outside.size:
        x, y = states[outside[0], :2]
        raise RecordingError(
            f"{name}: {outside[0] / RATE:g} s after its start the robot is {x:.2f} m, {y:.2f} m from the middle of its "
            f"ground, which ends at {half[0]:.2f} m, {half[1]:.2f} m"
        )
    above = states[:, 2] - height_at(ground.heights, states[:, 0], states[:, 1], ground.spacing)
    if abs(np.median(above)) > ABOVE:
        raise RecordingError(
            f"{name}: the robot is {np.median(above):.2f} m above the ground (median); is it another map?"
        )
    for words, heights in {
        "upside down (its first row is that of the smallest y)": ground.heights[::-1],
        "the wrong way round (its first column is that of the smallest x)": ground.heights[:, ::-1],
        "transposed (a row is along x)": ground.heights.T,
    }.items():
        other = states[:, 2] - height_at(heights, states[:, 0], states[:, 1], ground.spacing)
        if other.std() < FLIPPED * above.std() and above.std() > LEAST_WAY / 2:
            raise RecordingError(f"{name}: the map of the ground seems to be {words}")


def refuse_other_velocities(name: str, states: np.ndarray) -> None:
    """RecordingError where positions jump, or velocities do not lead where the robot was, over windows of a second."""
    attitudes, position = Rotation.from_quat(states[:, QUATERNION]), states[:, POSITION]
    world = attitudes.apply(states[:, TWIST][:, :3])
    step = np.diff(position, axis=0) - _between(world) / RATE  # (K, 3) m, unexplained
    jumps = np.flatnonzero(np.linalg.norm(step, axis=1) > JUMP + np.linalg.norm(world[1:], axis=1) / RATE)
    if jumps.size:
        when = jumps[0] / RATE
        raise RecordingError(f"{name}: {when:g} s after its start the position jumps; make two recordings of it there")
    off, way = _size(_windows(step)), _size(_windows(np.linalg.norm(np.diff(position, axis=0), axis=1)[:, None]))
    if off > max(MISFIT * way, LEAST_WAY):
        raise RecordingError(
            f"{name}: velocities do not lead where the robot was ({off:.2f} of {way:.2f} m a second); "
            "they must be in the body frame, x forward, y left"
        )


def refuse_other_rates(name: str, states: np.ndarray, rate: float) -> None:
    """RecordingError where angular velocities do not turn the robot as its attitudes did, and other readings would.

    Args:
        name: for the message.
        states: (R, 13), of all rows: what shakes faster than the control steps is not seen at their rate.
        rate: rows a second, Hz.
    """
    attitudes = Rotation.from_quat(states[:, QUATERNION])
    turned = (attitudes[:-1].inv() * attitudes[1:]).as_rotvec()  # (R - 1, 3) rad, body frame
    said = states[:, TWIST][:, 3:]
    second, shorter = round(rate), round(SHORTER * rate)
    for axis, column in enumerate(STATE[TWIST][3:]):
        sizes = [_size(_windows(some[:, axis : axis + 1], second)) for some in (turned, _between(said) / rate)]
        if max(sizes) > max(TIMES * min(sizes), LEAST_TURN):
            raise RecordingError(
                f"{name}: it turned by {sizes[0]:.2g} rad a second by its attitudes, by {sizes[1]:.2g} by '{column}'; "
                "is it in the unit that the header names?"
            )
    off = {words: _size(_windows(turned - _between(read(said, attitudes)) / rate, shorter)) for words, read in
           READINGS.items()}  # fmt: skip
    best, own = min(off, key=off.__getitem__), _size(_windows(turned - _between(said) / rate, shorter))
    if own > LEAST_MISFIT and off[best] < BETTER * own:
        raise RecordingError(
            f"{name}: angular velocities fit the attitudes better {best}; "
            "they must be in the body frame, x forward, y left, z up, positive to the left about z"
        )


def refuse_other_steering(name: str, recordings: Sequence[Recording]) -> None:
    """RecordingError where robots that drive forward turn the other way than they are steered.

    All recordings are judged together: ground turns a robot as well, and in a single one that may be the most of it.
    Driving backwards is not judged, for a car then turns the other way and a robot with tracks does not.
    """
    pairs = np.concatenate([
        np.stack([one.actions[:, 1] * speed, one.states[1:, TWIST][:, 5]], axis=1)[speed > FORWARD]
        for one in recordings
        for speed in [one.states[1:, TWIST][:, 0]]
    ])  # fmt: skip
    if len(pairs) < FEWEST_STEPS or (pairs.std(0) < LEAST_STEERED).any():
        return
    alike = np.corrcoef(pairs.T)[0, 1]
    if alike > OTHER_WAY:
        raise RecordingError(f"{name}: robots turn against their steering, which must be positive to the right")


def _between(rows: np.ndarray) -> np.ndarray:
    """Means of neighbouring rows."""
    return (rows[1:] + rows[:-1]) / 2


def _size(windows: np.ndarray) -> float:
    """Root mean square of the lengths of (W, N)."""
    return float(np.sqrt(np.square(windows).sum(1).mean()))


def _windows(steps: np.ndarray, length: int = WINDOW) -> np.ndarray:
    """Sums (W, N) over successive windows of (K, N)."""
    count = len(steps) // length
    return steps[: count * length].reshape(count, length, -1).sum(1)
