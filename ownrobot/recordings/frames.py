"""Columns of recordings compared with each other: frames, signs, units and maps.

Poses say how a robot moved. What contradicts them is refused. A fault that contradicts
nothing, such as a throttle of the other sign, stays unnoticed.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

# attitudes as arrays; those of `sidm.rotations` are tensors
from scipy.spatial.transform import Rotation

from ownrobot.recordings.checks import constant_columns, has_twist
from ownrobot.recordings.table import RecordingError
from sidm.body import DRIVE, Body
from sidm.drives import QUATERNION, Drive, Ground, yaw_of
from sidm.terrain import height_at

MAX_ABOVE = 2.0  # m, a robot that is farther from the ground, median, has another map
#: The height above the ground varies by less than this share on another reading of the
#: map, if that reading is the right one; and by at least so much, m, on the wrong one.
FLIPPED, LEAST_SPREAD = 0.25, 0.05

#: Rates and velocities are compared with poses if the larger of both has at least this
#: root mean square, rad/s and m/s; their ratio is at most RATE_RATIO.
LEAST_YAW_RATE, LEAST_SPEED, RATE_RATIO = 0.05, 0.05, 1.7

WINDOW = 1.0  # s, windows over which velocities are compared with positions
#: Largest root mean square of what velocities leave unexplained in a window: a share of
#: the way, and m, for noise and for shocks between two rows.
UNEXPLAINED_WAY, NOISE = 0.3, 0.1
JUMP = 0.5  # m, in one step, beyond what the velocity explains

TURN_WINDOW = 0.5  # s, windows over which angular velocities and attitudes are compared
FEWEST_WINDOWS = 10  # fewer are not compared
#: A column of angular velocities is in another unit if it turns the robot TURN_RATIO
#: times as far as the attitudes, or as little, and one of both by at least LEAST_TURN
#: rad in a window.
TURN_RATIO, LEAST_TURN = 20.0, 0.15
#: Other axes or another frame are the right ones if angular velocities leave more than
#: UNEXPLAINED_TURN rad of a window unexplained, and with the other ones less than
#: BETTER times as much.
UNEXPLAINED_TURN, BETTER = 0.15, 0.7

#: Steering is compared with turning in at least FEWEST_STEPS steps faster than FORWARD
#: m/s, in which steering times speed and turning have standard deviations of at least
#: LEAST_STEERING. The right sign gives a negative correlation; one above OTHER_SIGN
#: shows the other sign.
FORWARD, FEWEST_STEPS, LEAST_STEERING, OTHER_SIGN = 0.2, 30, 0.1, 0.4

#: Orders and signs of three axes, but for the one that changes nothing.
AXES = [
    (order, signs)
    for order in itertools.permutations(range(3))
    for signs in itertools.product((1, -1), repeat=3)
][1:]
ANGULAR = ("wx", "wy", "wz")


def refuse_other_maps(states: np.ndarray, ground: Ground | None, body: Body) -> None:
    """Refuse states (K + 1, S) that fit no map, or a flipped one better."""
    if ground is None:
        return
    half = [(size - 1) / 2 * ground.spacing for size in reversed(ground.heights.shape)]
    outside = np.flatnonzero((np.abs(states[:, :2]) > half).any(1))
    if outside.size:
        x, y = states[outside[0], :2]
        raise RecordingError(
            f"{outside[0] / body.rate:g} s after its start the robot is "
            f"{x:.2f} m, {y:.2f} m from the middle of its ground, "
            f"which ends at {half[0]:.2f} m, {half[1]:.2f} m"
        )
    if body.pose != "spatial":
        return
    x, y, z = states[:, :3].T
    above = z - height_at(ground.heights, x, y, ground.spacing)
    if abs(np.median(above)) > MAX_ABOVE:
        raise RecordingError(
            f"the robot is {np.median(above):.2f} m above the ground (median); "
            "is it another map?"
        )
    mirrored = ground.heights[:, ::-1]
    others = {
        "upside down (its first row is that of the smallest y)": ground.heights[::-1],
        "the wrong way round (its first column is that of the smallest x)": mirrored,
        "transposed (a row is along x)": ground.heights.T,
    }
    for fault, heights in others.items():
        other = z - height_at(heights, x, y, ground.spacing)
        if other.std() < FLIPPED * above.std() and above.std() > LEAST_SPREAD:
            raise RecordingError(f"the map of the ground seems to be {fault}")


def refuse_other_velocities(states: np.ndarray, body: Body) -> None:
    """Refuse states (K + 1, S) whose positions jump or contradict velocities."""
    rate, attitudes = body.rate, Rotation.from_quat(states[:, 3:7])
    velocities = attitudes.apply(states[:, 7:10])  # world frame
    moved = np.diff(states[:, :3], axis=0)  # (K, 3) m
    unexplained = moved - _between(velocities) / rate
    explained = np.linalg.norm(velocities[1:], axis=1) / rate
    jumps = np.flatnonzero(np.linalg.norm(unexplained, axis=1) > JUMP + explained)
    if jumps.size:
        raise RecordingError(
            f"{jumps[0] / rate:g} s after its start the position jumps; "
            "make two drives of it there"
        )
    off = _rms(_window_sums(unexplained, WINDOW * rate))
    way = _rms(_window_sums(np.linalg.norm(moved, axis=1)[:, None], WINDOW * rate))
    if off > max(UNEXPLAINED_WAY * way, NOISE):
        raise RecordingError(
            f"velocities do not lead where the robot was ({off:.2f} of {way:.2f} m a "
            "second); they must be in the body frame, x forward, y left"
        )


def refuse_other_turning(drives: Sequence[tuple[np.ndarray, float]]) -> None:
    """Refuse angular velocities that turn a robot otherwise than its attitudes did.

    All drives are compared together, states (R, 13) of all recorded rows and their
    rate, Hz: a short drive on level ground turns too little, and shaking is faster than
    the control steps. A wrong unit of a column is refused, and axes or a frame where
    other ones fit better.
    """
    parts = []  # rad in each window: by attitudes, by rates, by rates in the world
    for states, rate in drives:
        attitudes, rates = Rotation.from_quat(states[:, 3:7]), states[:, 10:13]
        turned = (attitudes[:-1].inv() * attitudes[1:]).as_rotvec()
        world_rates = attitudes.apply(rates, inverse=True)
        steps = turned, _between(rates) / rate, _between(world_rates) / rate
        parts.append([_window_sums(step, TURN_WINDOW * rate) for step in steps])
    if sum(len(turned) for turned, _, _ in parts) < FEWEST_WINDOWS:
        return
    turned, rates, world_rates = map(np.concatenate, zip(*parts, strict=True))
    for axis, column in enumerate(ANGULAR):
        by_attitude, by_rate = (_rms(turn[:, [axis]]) for turn in (turned, rates))
        least, most = sorted((by_attitude, by_rate))
        if most > max(TURN_RATIO * least, LEAST_TURN):
            raise RecordingError(
                f"it turned by {by_attitude / TURN_WINDOW:.2g} rad a second by "
                f"its attitudes, by {by_rate / TURN_WINDOW:.2g} by '{column}'; "
                "is it in the unit that the header names?"
            )
    off = _rms(turned - rates)
    if off < UNEXPLAINED_TURN:
        return
    others = {}
    for order, signs in AXES:
        pairs = zip(order, signs, strict=True)
        axes = [f"{'-' if sign < 0 else ''}{ANGULAR[axis]}" for axis, sign in pairs]
        others[f"as ({', '.join(axes)})"] = _rms(turned - rates[:, order] * signs)
    others["as rates in the world's frame"] = _rms(turned - world_rates)
    better = min(others, key=others.__getitem__)
    if others[better] < BETTER * off:
        raise RecordingError(
            f"angular velocities fit the attitudes better {better}; they must be in "
            "the body frame, x forward, y left, z up, positive to the left about z"
        )


def faults_together(
    name: str, drives: Sequence[Drive], body: Body, allow_constant: bool = False
) -> list[str]:
    """What only all drives of a robot show together, one line each.

    A column never changes, unless `allow_constant` accepts that; a rate or a velocity
    differs from the poses; or, with a twist, the steering has the wrong sign.
    """
    faults = [
        f"'{column}' never changes; mend it, or leave it out of the body"
        for column in ([] if allow_constant else constant_columns(drives, body))
    ]
    if not has_twist(body):
        faults += _other_rate(drives, body)
    elif body.actions == DRIVE:
        faults += _other_steering(drives)
    return [f"{name}: {fault}" for fault in faults]


def _other_rate(drives: Sequence[Drive], body: Body) -> list[str]:
    """The first yaw rate or forward velocity that differs from that of the poses."""
    if body.pose == "none":
        return []
    names = [column for column, _ in body.columns]
    motions = []
    for drive in drives:
        yaw = yaw_of_drive(drive)
        x, y = (np.diff(drive.states[:, :2], axis=0) * body.rate).T
        forward = x * np.cos(yaw[:-1]) + y * np.sin(yaw[:-1])
        motions.append((np.diff(yaw) * body.rate, forward))
    turning, forward = map(np.concatenate, zip(*motions, strict=True))
    for column, moved, least in (
        ("yaw_rate", turning, LEAST_YAW_RATE),
        ("wz", turning, LEAST_YAW_RATE),
        ("vx", forward, LEAST_SPEED),
    ):
        if column not in names:
            continue
        number = body.pose_size + names.index(column)
        recorded = np.concatenate([_between(d.states[:, number]) for d in drives])
        if max(np.mean(recorded**2), np.mean(moved**2)) < least**2:
            continue
        if not recorded.any():
            return [f"'{column}' is always 0, but the poses move; mend its sensor"]
        slope = float((recorded * moved).sum() / (recorded**2).sum())
        if not 1 / RATE_RATIO < slope < RATE_RATIO:
            fault = "of the other sign" if slope < 0 else "in another unit or frame"
            return [
                f"the poses move {slope:.2g} times as '{column}' says; "
                f"is it {fault}, or does its sensor fail?"
            ]
    return []


def _other_steering(drives: Sequence[Drive]) -> list[str]:
    """That robots turn against their steering while driving forward, if they do.

    All drives are checked together, because the ground turns a robot too, and in a
    single drive it may do so more than the steering. Driving backwards is not checked,
    because a car then turns the other way and a robot with tracks does not.
    """
    steering = np.concatenate([drive.actions[:, 1] for drive in drives])
    speed, turning = np.concatenate([d.states[1:, [7, 12]] for d in drives]).T
    pairs = np.stack([steering * speed, turning])[:, speed > FORWARD]
    if pairs.shape[1] < FEWEST_STEPS or (pairs.std(1) < LEAST_STEERING).any():
        return []
    if np.corrcoef(pairs)[0, 1] <= OTHER_SIGN:
        return []
    return ["robots turn against their steering, which must be positive to the right"]


def yaw_of_drive(drive: Drive) -> np.ndarray:
    """Yaw (K + 1,), rad, without jumps, of a drive with a pose."""
    if drive.body.pose == "planar":
        return drive.states[:, 2]
    return np.unwrap(yaw_of(drive.states[:, QUATERNION]))


def _between(rows: np.ndarray) -> np.ndarray:
    """Means (K, ...) of neighbouring rows (K + 1, ...)."""
    return (rows[1:] + rows[:-1]) / 2


def _rms(vectors: np.ndarray) -> float:
    """Root mean square of the lengths of vectors (W, N)."""
    return float(np.sqrt(np.square(vectors).sum(1).mean())) if len(vectors) else 0.0


def _window_sums(steps: np.ndarray, length: float) -> np.ndarray:
    """Sums (W, N) of steps (K, N) over successive windows of about `length` steps."""
    size = max(1, round(length))
    count = len(steps) // size
    return steps[: count * size].reshape(count, size, steps.shape[1]).sum(1)
