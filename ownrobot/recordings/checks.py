"""Faults of recorded numbers, each refused in one line that names file and place.

The checks here are of rows, values and units by themselves. `frames` compares columns
with each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ownrobot.recordings.table import RecordingError
from sidm.body import DRIVE, TWIST, Body
from sidm.drives import Drive, Ground

NOT_UNIT = 1e-3  # largest deviation of a quaternion's length from 1
BEYOND = 1e-3  # largest excess of throttle and steering over 1; it is clipped
LARGEST = 1e15  # in SI units; no sensor measures a larger number
#: A recording pauses where two rows are more than GAP median spacings apart, and more
#: than LEAST_PAUSE control steps.
GAP, LEAST_PAUSE = 3.0, 1.5
FASTER = 1.5  # largest ratio of the control steps' rate to that of recorded numbers
SLOWEST = 0.2  # Hz, of rows of a robot; slower ones have times in another unit
#: A position jumps in a step of more than JUMP metres that is also JUMP_RATIO times as
#: long as the 90th percentile of the steps of all drives.
JUMP, JUMP_RATIO = 1.0, 5.0


def has_twist(body: Body) -> bool:
    """Whether a state has attitude and velocities, which can then be compared."""
    return body.pose == "spatial" and body.columns[: len(TWIST)] == TWIST


def refuse_numbers(states: np.ndarray, actions: np.ndarray, body: Body) -> None:
    """Refuse states (R, S) or actions (R, A) with a number that cannot be measured."""
    numbers = np.hstack([states, actions])
    for row, column in np.argwhere(~(np.abs(numbers) <= LARGEST))[:1]:
        title, value = (*body.state, *body.actions)[column][0], numbers[row, column]
        fault = f"{value:.4g}, beyond 1e15" if np.isfinite(value) else "not finite"
        raise RecordingError(
            f"'{title}' in row {row + 1} is {fault}; leave the row out"
        )


def refuse_angles(column: str, angles: np.ndarray) -> None:
    """Refuse angles (R,), rad, that jump as degrees do where they are wrapped."""
    steps = np.abs(np.diff(angles))
    row = int(steps.argmax())
    if steps[row] > 3 * np.pi:
        raise RecordingError(
            f"'{column}' jumps by {steps[row]:.4g} rad after row {row + 1}; "
            "is it in degrees? Name its unit"
        )


def refuse_times(time: np.ndarray) -> float:
    """Refuse times (R,), s, that do not increase; returns their median spacing, s."""
    if not np.isfinite(time).all():
        row = np.flatnonzero(~np.isfinite(time))[0] + 1
        raise RecordingError(f"the time in row {row} is not finite; leave the row out")
    steps = np.diff(time)
    if not len(steps):
        rows = "1 row is" if len(time) == 1 else "0 rows are"
        raise RecordingError(f"{rows} no drive; leave it out")
    back = np.flatnonzero(steps <= 0)
    if back.size:
        row = int(back[0])
        fault, mend = "the same time as the row before it", "leave one of them out"
        if steps[row] < 0:
            fault = f"a time {-steps[row]:.4g} s before the row before it"
            mend = "cut the file there, or name the parts in a column 'drive'"
        raise RecordingError(f"row {row + 2} has {fault}; {mend}")
    return float(np.median(steps))


def pauses(time: np.ndarray, rate: float) -> np.ndarray:
    """Numbers (P,) of the rows before which a recording pauses; `rate` is in Hz."""
    steps = np.diff(time)
    return np.flatnonzero(steps > max(GAP * np.median(steps), LEAST_PAUSE / rate)) + 1


def refuse_slower(row_rate: float, pose_rate: float | None, body: Body) -> None:
    """Refuse a body with a higher rate than the rows or the new poses have, Hz."""
    for rate, what in ((row_rate, "rows come"), (pose_rate, "its pose is new")):
        if rate is not None and body.rate > FASTER * rate:
            mend = f"write 'rate: {plain_rate(rate):.3g} Hz' in the body"
            if rate < SLOWEST:
                mend = "is 'time' in ms? Name its unit"
            raise RecordingError(
                f"{what} at {rate:.3g} Hz, but body '{body.name}' has steps at "
                f"{body.rate:g} Hz; {mend}"
            )


def plain_rate(rate: float) -> float:
    """A rate, Hz, with two digits, rounded downwards where there are more."""
    digit = 10.0 ** (math.floor(math.log10(rate)) - 1)
    return round(math.floor(rate / digit + 0.05) * digit, 9)


def unit_quaternions(quaternions: np.ndarray, part: str = "") -> np.ndarray:
    """Quaternions (R, 4) scaled to length 1; refuses one whose length is far from 1."""
    length = np.linalg.norm(quaternions, axis=1)
    off = np.flatnonzero(np.abs(length - 1) > NOT_UNIT)
    if off.size:
        raise RecordingError(
            f"{part}the quaternion in row {off[0] + 1} has "
            f"length {length[off[0]]:.4g}, not 1"
        )
    return quaternions / length[:, None]


def within_limits(actions: np.ndarray, body: Body) -> np.ndarray:
    """Actions (K, A); throttle and steering beyond [-1, 1] are clipped or refused."""
    if body.actions != DRIVE:
        return actions
    for row, column in np.argwhere(np.abs(actions) > 1 + BEYOND)[:1]:
        action, value = body.actions[column][0], actions[row, column]
        raise RecordingError(
            f"{action} in step {row + 1} is {value:.4g}, not in [-1, 1]; scale it"
        )
    return np.clip(actions, -1, 1)


def whole_ground(ground: Ground) -> Ground:
    """The ground moved so that its middle is the origin; refuses an invalid ground."""
    heights = np.asarray(ground.heights)
    if heights.ndim != 2 or min(heights.shape) < 2 or heights.dtype.kind not in "fiu":
        raise RecordingError(
            f"a ground of shape {heights.shape} and {heights.dtype}, "
            "not a grid of heights"
        )
    for row, column in np.argwhere(~np.isfinite(heights))[:1]:
        raise RecordingError(
            f"the height in row {row + 1}, column {column + 1} is not finite"
        )
    if not (math.isfinite(ground.spacing) and ground.spacing > 0):
        raise RecordingError(
            f"a spacing of {ground.spacing} m of the ground's grid; it must be positive"
        )
    if not np.isfinite(ground.centre).all():
        raise RecordingError(
            f"the middle of the ground at {ground.centre} is not finite"
        )
    return Ground(heights.astype(float), ground.spacing)


def constant_columns(drives: Sequence[Drive], body: Body) -> list[str]:
    """Columns that never change in any drive, as a dead sensor's does not.

    Columns of a body with a twist are compared with each other instead.
    """
    if has_twist(body):
        return []
    states = np.concatenate([drive.states[:, body.pose_size :] for drive in drives])
    actions = np.concatenate([drive.actions for drive in drives])
    columns, values = (*body.columns, *body.actions), (*states.T, *actions.T)
    return [
        name
        for (name, _), numbers in zip(columns, values, strict=True)
        if np.ptp(numbers) == 0
    ]


def jumps(drives: Sequence[Drive], body: Body) -> dict[int, RecordingError]:
    """Number of each drive whose position jumps -> fault; not for a twist's body."""
    if body.pose == "none" or has_twist(body) or not drives:
        return {}
    faults = {}
    steps = [
        np.linalg.norm(np.diff(drive.states[:, :2], axis=0), axis=1) for drive in drives
    ]
    limit = max(JUMP, JUMP_RATIO * float(np.quantile(np.concatenate(steps), 0.9)))
    for number, (drive, step) in enumerate(zip(drives, steps, strict=True)):
        far = np.flatnonzero(step > limit)
        if far.size:
            faults[number] = RecordingError(
                f"{(far[0] + 1) / body.rate:.4g} s after its start the robot is "
                f"{step[far[0]]:.3g} m farther within one step; make two drives of it "
                "there",
                drive.name,
            )
    return faults
