"""What tells that recorded numbers are not those of driving: faults of a row, other frames, signs, units or maps.

What fits all that and is wrong all the same, such as a throttle of the other sign,
nobody sees.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

# attitudes as arrays; those of `sidm.rotations` are tensors
from scipy.spatial.transform import Rotation

from sidm.body import DRIVE, TWIST, Body
from sidm.drives import QUATERNION, Drive, Ground, yaw_of
from sidm.recordings.table import RecordingError
from sidm.terrain import height_at

NOT_UNIT = 1e-3  # that a quaternion's length may be off
BEYOND = 1e-3  # that throttle and steering may be beyond 1
GAP = 3.0  # median spacings between two rows: more is a gap
#: m in a step, and times the 90th percentile of the file: more of both is no driving
FAR, FASTER = 1.0, 5.0
#: rad/s and m/s, root mean squares: less is too little motion to judge columns by
SLOW_TURN, SLOW = 0.05, 0.05
#: times as much motion as a column says, or as little, is taken for another unit
OFF = 1.7
#: m, between a robot and the ground under it, more is taken for a map of other ground
ABOVE = 2.0
#: of how a robot moves up and down over its ground: so much less over another reading
#: is taken for that
FLIPPED = 0.25
WINDOW = 1.0  # s, over which velocities are held against what they lead to
MISFIT = 0.3  # of the way, between the two, more is taken for another frame or unit
#: m and rad a window that are no misfit: noise, and shocks between two rows
LEAST_WAY, LEAST_TURN = 0.1, 0.3
#: as much turning by its rates as by its attitudes, or as little, is taken for another
#: unit
TIMES = 20.0
JUMP = 0.5  # m, in one step beside what the velocity leads to
#: s, of the windows over which angular velocities are held against attitudes
SHORTER = 0.5
#: rad a window, of turning that angular velocities do not explain, for them to be
#: doubted
LEAST_MISFIT = 0.15
BETTER = 0.7  # of it: what leaves less unexplained is taken for how they should be read
FORWARD, FEWEST_STEPS = 0.2, 30  # m/s, and steps as fast, to judge steering by
#: m/s and rad/s, standard deviations of steering by speed and of turning
LEAST_STEERED = 0.1
#: correlation of the two: more is taken for the other sign, as it is negative
OTHER_WAY = 0.4

Reading = Callable[[np.ndarray, Rotation], np.ndarray]

#: Angular velocities (K, 3) that would be right if they were read so, with the
#: attitudes; none changes their size.
READINGS: dict[str, Reading] = {
    "with the other sign": lambda rates, _: -rates,
    "as those of a frame with x forward, y right, z down": lambda rates, _: (
        rates * (1, -1, -1)
    ),
    "as those of the world's frame": lambda rates, attitudes: attitudes.apply(
        rates, inverse=True
    ),
    "with 'wx' and 'wy' exchanged": lambda rates, _: rates[:, (1, 0, 2)],
    "with 'wx' of the other sign": lambda rates, _: rates * (-1, 1, 1),
    "with 'wy' of the other sign": lambda rates, _: rates * (1, -1, 1),
    "with 'wz' of the other sign": lambda rates, _: rates * (1, 1, -1),
}


def refuse_numbers(
    name: str, states: np.ndarray, actions: np.ndarray, body: Body
) -> None:
    """RecordingError where a number of states (R, S) or actions (R, A) is not finite."""
    bad = np.argwhere(~np.isfinite(np.hstack([states, actions])))
    if len(bad):
        row, column = bad[0]
        raise RecordingError(
            f"{name}: '{(*body.state, *body.actions)[column][0]}' in row {row + 1} is not finite"
        )


def refuse_times(name: str, time: np.ndarray) -> float:
    """The median spacing of the rows, s; RecordingError for times that do not grow or leave a gap."""
    if not np.isfinite(time).all():
        raise RecordingError(
            f"{name}: the time in row {np.flatnonzero(~np.isfinite(time))[0] + 1} is not finite"
        )
    steps = np.diff(time)
    if not len(steps):
        raise RecordingError(f"{name}: {len(time)} rows are no drive")
    back = np.flatnonzero(steps <= 0)
    if back.size:
        row = int(back[0])
        what = "the same time as" if steps[row] == 0 else f"{-steps[row]:.4g} s before"
        raise RecordingError(
            f"{name}: row {row + 2} has {what} the row before it; sort the rows, each time once"
        )
    spacing = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP * spacing)
    if gaps.size:
        row = int(gaps[0])
        raise RecordingError(
            f"{name}: row {row + 2} comes {steps[row]:.4g} s after the row before, where rows are {spacing:.4g} s "
            "apart; make two drives of it there"
        )
    return spacing


def unit_quaternions(name: str, given: np.ndarray) -> np.ndarray:
    """Quaternions (R, 4) at unit length; RecordingError where one is far from it."""
    length = np.linalg.norm(given, axis=1)
    off = np.flatnonzero(np.abs(length - 1) > NOT_UNIT)
    if off.size:
        raise RecordingError(
            f"{name}: the quaternion in row {off[0] + 1} has length {length[off[0]]:.4g}, not 1"
        )
    return given / length[:, None]


def within_limits(name: str, actions: np.ndarray, body: Body) -> np.ndarray:
    """Actions (K, A), throttle and steering of the paper's robots in [-1, 1]; RecordingError where they are beyond."""
    if body.actions != DRIVE:
        return actions
    beyond = np.argwhere(np.abs(actions) > 1 + BEYOND)
    if len(beyond):
        row, column = beyond[0]
        what = (
            f"{body.actions[column][0]} in step {row + 1} is {actions[row, column]:.4g}"
        )
        raise RecordingError(f"{name}: {what}, not in [-1, 1]; scale it")
    return np.clip(actions, -1, 1)


def whole_ground(name: str, ground: Ground) -> Ground:
    """The ground about the origin; RecordingError where it is none."""
    heights = np.asarray(ground.heights)
    if heights.ndim != 2 or min(heights.shape) < 2 or heights.dtype.kind not in "fiu":
        raise RecordingError(
            f"{name}: a ground of shape {heights.shape} and {heights.dtype}, not a grid of heights"
        )
    bad = np.argwhere(~np.isfinite(heights))
    if len(bad):
        raise RecordingError(
            f"{name}: the height in row {bad[0][0] + 1}, column {bad[0][1] + 1} is not finite"
        )
    if not (math.isfinite(ground.spacing) and ground.spacing > 0):
        raise RecordingError(
            f"{name}: a spacing of {ground.spacing} m of the ground's grid; it must be positive"
        )
    if not np.isfinite(ground.centre).all():
        raise RecordingError(
            f"{name}: the middle of the ground at {ground.centre} is not finite"
        )
    return Ground(heights.astype(float), ground.spacing)


def refuse_together(name: str, drives: Sequence[Drive], body: Body) -> None:
    """RecordingError for what all drives of a robot say together: other units, steering to the left."""
    if not has_twist(body):  # whose columns are held against each other, drive by drive
        _refuse_other_rates(name, drives, body)
    elif body.actions == DRIVE:
        refuse_other_steering(name, drives)


def refuse_constant(name: str, drives: Sequence[Drive], body: Body) -> None:
    """RecordingError naming the first column that never changes in any drive, as a dead sensor's does not.

    Of a body that has no twist, whose columns would be held against each other.
    """
    if has_twist(body):
        return
    for kind, columns in (
        ("states", body.state[body.pose_size :]),
        ("actions", body.actions),
    ):
        values = (
            np.concatenate(
                [getattr(drive, kind)[:, -len(columns) :] for drive in drives]
            )
            if columns
            else None
        )
        for number, (column, _) in enumerate(columns):
            assert values is not None
            if np.ptp(values[:, number]) == 0:
                raise RecordingError(
                    f"{name}: '{column}' never changes; mend it, or leave it out of the body"
                )


def _refuse_other_rates(name: str, drives: Sequence[Drive], body: Body) -> None:
    """RecordingError where a yaw rate or a forward velocity is not that of the poses: another sign, unit or frame."""
    names = [column for column, _ in body.columns]
    if body.pose == "none":
        return
    moved_all = [_motion(drive, body) for drive in drives]
    heading, forward = (np.concatenate(parts) for parts in zip(*moved_all, strict=True))
    for column, moved, least in (
        ("yaw_rate", heading, SLOW_TURN),
        ("wz", heading, SLOW_TURN),
        ("vx", forward, SLOW),
    ):
        if column not in names:
            continue
        number = body.pose_size + names.index(column)
        told = np.concatenate(
            [
                (drive.states[1:, number] + drive.states[:-1, number]) / 2
                for drive in drives
            ]
        )
        if max(np.mean(told**2), np.mean(moved**2)) < least**2:
            continue
        slope = float((told * moved).sum() / max((told**2).sum(), 1e-12))
        if not 1 / OFF < slope < OFF:
            what = "of the other sign" if slope < 0 else "in another unit or frame"
            raise RecordingError(
                f"{name}: the poses move {slope:.2g} times as '{column}' says; is it {what}, or does its sensor fail?"
            )


def _motion(drive: Drive, body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Turning, rad/s, and forward motion, m/s, (K,) each, by the poses of a drive."""
    states = drive.states
    if body.pose == "planar":
        yaw = states[:, 2]
    else:
        yaw = np.unwrap(yaw_of(states[:, QUATERNION]))
    way = np.diff(states[:, :2], axis=0) * body.rate
    return np.diff(yaw) * body.rate, way[:, 0] * np.cos(yaw[:-1]) + way[:, 1] * np.sin(
        yaw[:-1]
    )


def refuse_jumps(drives: Sequence[Drive], body: Body) -> None:
    """RecordingError where a robot is suddenly elsewhere, of one whose velocities are not seen."""
    if body.pose == "none" or has_twist(body):
        return
    steps = [
        np.linalg.norm(np.diff(drive.states[:, :2], axis=0), axis=1) for drive in drives
    ]
    most = max(FAR, FASTER * float(np.quantile(np.concatenate(steps), 0.9)))
    for drive, step in zip(drives, steps, strict=True):
        far = np.flatnonzero(step > most)
        if far.size:
            raise RecordingError(
                f"{drive.name}: {(far[0] + 1) / body.rate:.4g} s after its start the robot is {step[far[0]]:.3g} m "
                "farther within one step; make two drives of it there"
            )


def has_twist(body: Body) -> bool:
    """Whether a body's state has attitude, velocity and angular velocity, each of which says what the others do."""
    return body.pose == "spatial" and body.columns[: len(TWIST)] == TWIST


def refuse_other_maps(
    name: str, states: np.ndarray, ground: Ground | None, body: Body
) -> None:
    """RecordingError where states (K + 1, S) leave the map, lie far above it, or fit another reading of it better."""
    if ground is None:
        return
    half = [(size - 1) / 2 * ground.spacing for size in reversed(ground.heights.shape)]
    outside = np.flatnonzero((np.abs(states[:, :2]) > half).any(1))
    if outside.size:
        x, y = states[outside[0], :2]
        raise RecordingError(
            f"{name}: {outside[0] / body.rate:g} s after its start the robot is {x:.2f} m, {y:.2f} m from the middle "
            f"of its ground, which ends at {half[0]:.2f} m, {half[1]:.2f} m"
        )
    if body.pose != "spatial":
        return
    above = states[:, 2] - height_at(
        ground.heights, states[:, 0], states[:, 1], ground.spacing
    )
    if abs(np.median(above)) > ABOVE:
        raise RecordingError(
            f"{name}: the robot is {np.median(above):.2f} m above the ground (median); is it another map?"
        )
    for words, heights in {
        "upside down (its first row is that of the smallest y)": ground.heights[::-1],
        "the wrong way round (its first column is that of the smallest x)": ground.heights[
            :, ::-1
        ],
        "transposed (a row is along x)": ground.heights.T,
    }.items():
        other = states[:, 2] - height_at(
            heights, states[:, 0], states[:, 1], ground.spacing
        )
        if other.std() < FLIPPED * above.std() and above.std() > LEAST_WAY / 2:
            raise RecordingError(f"{name}: the map of the ground seems to be {words}")


def refuse_other_velocities(name: str, states: np.ndarray, body: Body) -> None:
    """RecordingError where positions jump, or velocities do not lead where the robot was, over windows of a second.

    Of a body that `has_twist`.
    """
    rate, position = body.rate, states[:, :3]
    world = Rotation.from_quat(states[:, 3:7]).apply(states[:, 7:10])
    step = np.diff(position, axis=0) - _between(world) / rate  # (K, 3) m, unexplained
    jumps = np.flatnonzero(
        np.linalg.norm(step, axis=1) > JUMP + np.linalg.norm(world[1:], axis=1) / rate
    )
    if jumps.size:
        when = jumps[0] / rate
        raise RecordingError(
            f"{name}: {when:g} s after its start the position jumps; make two drives of it there"
        )
    second = max(1, round(WINDOW * rate))
    ways = np.linalg.norm(np.diff(position, axis=0), axis=1)[:, None]
    off, way = _size(_windows(step, second)), _size(_windows(ways, second))
    if off > max(MISFIT * way, LEAST_WAY):
        raise RecordingError(
            f"{name}: velocities do not lead where the robot was ({off:.2f} of {way:.2f} m a second); "
            "they must be in the body frame, x forward, y left"
        )


def refuse_other_turning(name: str, states: np.ndarray, rate: float) -> None:
    """RecordingError where angular velocities do not turn the robot as its attitudes did, and other readings would.

    Args:
        name: for the message.
        states: (R, 13), of all rows: what shakes faster than the control steps is not
            seen at their rate.
        rate: rows a second, Hz.
    """
    attitudes = Rotation.from_quat(states[:, 3:7])
    # (R - 1, 3) rad, body frame
    turned = (attitudes[:-1].inv() * attitudes[1:]).as_rotvec()
    said = states[:, 10:13]
    second, shorter = (max(1, round(some * rate)) for some in (WINDOW, SHORTER))
    for axis, column in enumerate(("wx", "wy", "wz")):
        sizes = [
            _size(_windows(some[:, axis : axis + 1], second))
            for some in (turned, _between(said) / rate)
        ]
        if max(sizes) > max(TIMES * min(sizes), LEAST_TURN):
            raise RecordingError(
                f"{name}: it turned by {sizes[0]:.2g} rad a second by its attitudes, by {sizes[1]:.2g} by '{column}'; "
                "is it in the unit that the header names?"
            )
    off = {
        words: _size(_windows(turned - _between(read(said, attitudes)) / rate, shorter))
        for words, read in READINGS.items()
    }
    best, own = (
        min(off, key=off.__getitem__),
        _size(_windows(turned - _between(said) / rate, shorter)),
    )
    if own > LEAST_MISFIT and off[best] < BETTER * own:
        raise RecordingError(
            f"{name}: angular velocities fit the attitudes better {best}; "
            "they must be in the body frame, x forward, y left, z up, positive to the left about z"
        )


def refuse_other_steering(name: str, drives: Sequence[Drive]) -> None:
    """RecordingError where robots that drive forward turn the other way than they are steered.

    All drives are judged together: ground turns a robot as well, and in a single one
    that may be the most of it. Driving backwards is not judged, for a car then turns
    the other way and a robot with tracks does not.
    """
    pairs = np.concatenate(
        [
            np.stack([one.actions[:, 1] * speed, one.states[1:, 12]], axis=1)[
                speed > FORWARD
            ]
            for one in drives
            for speed in [one.states[1:, 7]]
        ]
    )
    if len(pairs) < FEWEST_STEPS or (pairs.std(0) < LEAST_STEERED).any():
        return
    alike = np.corrcoef(pairs.T)[0, 1]
    if alike > OTHER_WAY:
        raise RecordingError(
            f"{name}: robots turn against their steering, which must be positive to the right"
        )


def _between(rows: np.ndarray) -> np.ndarray:
    """Means of neighbouring rows."""
    return (rows[1:] + rows[:-1]) / 2


def _size(windows: np.ndarray) -> float:
    """Root mean square of the lengths of (W, N)."""
    return float(np.sqrt(np.square(windows).sum(1).mean())) if len(windows) else 0.0


def _windows(steps: np.ndarray, length: int) -> np.ndarray:
    """Sums (W, N) over successive windows of (K, N)."""
    count = len(steps) // length
    return steps[: count * length].reshape(count, length, steps.shape[1]).sum(1)
