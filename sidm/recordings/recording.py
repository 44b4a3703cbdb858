"""A recording in memory, and what can be wrong with one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sidm.config import unknown_name
from sidm.terrain import height_at
from sidm.trajectory import ACTION_SIZE, POSITION, QUATERNION, STATE_SIZE, STEPS, TWIST

RATE = 10.0  # Hz, of the control steps
STATE = ("x", "y", "z", "qx", "qy", "qz", "qw", "vx", "vy", "vz", "wx", "wy", "wz")
ACTION = ("throttle", "steering")

#: Kind of quantity -> unit -> what it is in the SI's.
UNITS = {
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "km/h": 1 / 3.6},
    "angular velocity": {"rad/s": 1.0, "deg/s": math.pi / 180},
    "number": {"1": 1.0},
    "time": {"s": 1.0, "ms": 1e-3},
}

#: Column -> kind of quantity; all but the time have to be there.
COLUMNS = (
    dict.fromkeys(STATE[POSITION], "length") | dict.fromkeys(STATE[QUATERNION], "number")
    | dict.fromkeys(STATE[TWIST][:3], "velocity") | dict.fromkeys(STATE[TWIST][3:], "angular velocity")
    | dict.fromkeys(ACTION, "number") | {"time": "time"}
)  # fmt: skip

LATE = 0.5  # of a row, that a row's time may be off; a row that is missing is off by more
NOT_UNIT = 1e-3  # that a quaternion's length may be off
BEYOND = 1e-3  # that an action may be beyond 1
ABOVE = 2.0  # m, between a robot and the ground under it, more is taken for a map of other ground
WINDOW = 10  # control steps over which velocities are held against what they lead to
MISFIT = 0.3  # of the way, between the two, more is taken for another frame or unit
LEAST_WAY, LEAST_TURN = 0.1, 0.3  # m and rad a window that are no misfit: noise, and shocks between two rows
TIMES = 20.0  # as much turning by its rates as by its headings, or as little, is taken for another unit
JUMP = 0.5  # m, in one control step beside what the velocity leads to
FLIPPED = 0.25  # of how a robot moves up and down over its ground: so much less over another reading is taken for that


class RecordingError(ValueError):
    """What is wrong with a recording: one line that names file, place and fault."""


class Ground(NamedTuple):
    """The ground that was driven on."""

    heights: np.ndarray  # (H, W), m, index [y, x]
    spacing: float  # m, between neighbours of the grid
    centre: tuple[float, float] = (0.0, 0.0)  # x and y of the grid's middle, m


class Recording(NamedTuple):
    """K control steps of a robot from elsewhere; positions are relative to the middle of its ground."""

    name: str  # for messages
    states: np.ndarray  # (K + 1, 13) float64, as the table of `sidm.trajectory`
    actions: np.ndarray  # (K, 2) float64
    ground: Ground  # its centre at the origin

    @property
    def pieces(self) -> int:
        """How many trajectories of STEPS steps it holds; what is left over at its end is not used."""
        return len(self.actions) // STEPS


def from_table(
    name: str, columns: Sequence[str], units: Sequence[str], rate: float, rows: np.ndarray, ground: Ground
) -> Recording:
    """A recording from its table, held against all that is known to be true of one.

    Args:
        name: of the file, for messages.
        columns: names, of COLUMNS.
        units: one a column.
        rate: rows a second, Hz.
        rows: (R, C) numbers.
        ground: that was driven on.

    Raises:
        RecordingError: the first fault.
    """
    table = _in_si(name, columns, units, rows)
    stride = _stride(name, rate)
    if "time" in table:
        _refuse_gaps(name, table["time"], rate)
    _refuse_ground(name, ground)
    states, actions = (np.stack([table[column] for column in some], axis=1) for some in (STATE, ACTION))
    _refuse_numbers(name, states, actions)
    states[:, QUATERNION] /= np.linalg.norm(states[:, QUATERNION], axis=1, keepdims=True)
    states[:, :2] -= ground.centre
    steps = (len(states) - 1) // stride
    if steps < STEPS:
        raise RecordingError(f"{name}: {steps} steps of 0.1 s, fewer than the {STEPS} of a trajectory")
    states = states[: steps * stride + 1 : stride]
    actions = actions[: steps * stride].reshape(steps, stride, ACTION_SIZE).mean(1)
    ground = ground._replace(heights=np.asarray(ground.heights, float), centre=(0.0, 0.0))
    _refuse_elsewhere(name, states, ground)
    _refuse_other_frames(name, states)
    return Recording(name, states, np.clip(actions, -1, 1), ground)


def _in_si(name: str, columns: Sequence[str], units: Sequence[str], rows: np.ndarray) -> dict[str, np.ndarray]:
    """Columns by name, in SI units."""
    if len(units) != len(columns) or rows.ndim != 2 or rows.shape[1] != len(columns):
        raise RecordingError(f"{name}: {len(columns)} columns, {len(units)} units and rows of shape {rows.shape}")
    if rows.dtype.kind not in "fiu":
        raise RecordingError(f"{name}: rows of {rows.dtype}, not of numbers")
    table = {}
    for number, (column, unit) in enumerate(zip(columns, units, strict=True)):
        if column not in COLUMNS:
            raise RecordingError(f"{name}: {unknown_name(column, COLUMNS, 'the columns')}")
        if column in table:
            raise RecordingError(f"{name}: two columns '{column}'")
        known = UNITS[COLUMNS[column]]
        if unit not in known:
            raise RecordingError(f"{name}: '{column}' in '{unit}'; a {COLUMNS[column]} is in {' or '.join(known)}")
        table[column] = rows[:, number].astype(float) * known[unit]
    for column in (*STATE, *ACTION):
        if column not in table:
            raise RecordingError(f"{name}: column '{column}' is missing")
    return table


def _stride(name: str, rate: float) -> int:
    """Rows a control step."""
    stride = round(rate / RATE) if math.isfinite(rate) else 0
    if stride < 1 or abs(rate - stride * RATE) > 1e-6 * rate:
        raise RecordingError(f"{name}: a rate of {rate:g} Hz is no whole multiple of {RATE:g} Hz; resample it")
    return stride


def _refuse_gaps(name: str, time: np.ndarray, rate: float) -> None:
    late = (time - time[0]) * rate - np.arange(len(time))
    gaps = np.flatnonzero(~(np.diff(time) * rate < 1 + LATE) | ~(np.diff(time) > 0))
    if gaps.size:
        row = int(gaps[0])
        raise RecordingError(
            f"{name}: row {row + 2} comes {time[row + 1] - time[row]:.4g} s after the row before, "
            f"not {1 / rate:.4g} s; make two recordings of it there"
        )
    off = np.flatnonzero(~(np.abs(late) <= LATE))
    if off.size:
        row = int(off[0])
        raise RecordingError(
            f"{name}: row {row + 1} is at {time[row] - time[0]:.4g} s, not at {row / rate:.4g} s as the rate of "
            f"{rate:g} Hz has it; correct the rate, or resample"
        )


def _refuse_ground(name: str, ground: Ground) -> None:
    heights = np.asarray(ground.heights)
    if heights.ndim != 2 or min(heights.shape) < 2 or heights.dtype.kind not in "fiu":
        raise RecordingError(f"{name}: a ground of shape {heights.shape} and {heights.dtype}, not a grid of heights")
    bad = np.argwhere(~np.isfinite(heights))
    if len(bad):
        raise RecordingError(f"{name}: the height in row {bad[0][0] + 1}, column {bad[0][1] + 1} is not finite")
    if not (math.isfinite(ground.spacing) and ground.spacing > 0):
        raise RecordingError(f"{name}: a spacing of {ground.spacing} m of the ground's grid; it must be positive")
    if not np.isfinite(ground.centre).all():
        raise RecordingError(f"{name}: the middle of the ground at {ground.centre} is not finite")


def _refuse_numbers(name: str, states: np.ndarray, actions: np.ndarray) -> None:
    """Row by row: what no state or action can be."""
    both = np.hstack([states, actions])
    bad = np.argwhere(~np.isfinite(both))
    if len(bad):
        row, column = bad[0]
        raise RecordingError(f"{name}: '{(*STATE, *ACTION)[column]}' in row {row + 1} is not finite")
    length = np.linalg.norm(states[:, QUATERNION], axis=1)
    off = np.flatnonzero(np.abs(length - 1) > NOT_UNIT)
    if off.size:
        raise RecordingError(f"{name}: the quaternion in row {off[0] + 1} has length {length[off[0]]:.4g}, not 1")
    beyond = np.argwhere(np.abs(actions) > 1 + BEYOND)
    if len(beyond):
        row, column = beyond[0]
        value = actions[row, column]
        raise RecordingError(f"{name}: {ACTION[column]} in row {row + 1} is {value:.4g}, not in [-1, 1]; scale it")


def _refuse_elsewhere(name: str, states: np.ndarray, ground: Ground) -> None:
    """What tells of another map or another frame."""
    assert states.shape[1] == STATE_SIZE
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


def _refuse_other_frames(name: str, states: np.ndarray) -> None:
    """Velocities that do not lead where the robot was, over windows of a second, and positions that jump."""
    quaternions, position = states[:, QUATERNION], states[:, POSITION]
    world = _into_world(quaternions, states[:, TWIST][:, :3])
    step = np.diff(position, axis=0) - (world[1:] + world[:-1]) / 2 / RATE  # (K, 3) m, unexplained
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
    axis = _into_world(quaternions, np.broadcast_to([1.0, 0.0, 0.0], world.shape))
    turned = _size(_windows(np.diff(np.unwrap(np.arctan2(axis[:, 1], axis[:, 0])))[:, None]))
    rates = _into_world(quaternions, states[:, TWIST][:, 3:])[:, 2:]  # about the vertical
    said = _size(_windows((rates[1:] + rates[:-1]) / 2 / RATE))
    if max(said, turned) > max(TIMES * min(said, turned), LEAST_TURN):
        raise RecordingError(
            f"{name}: it turned by {turned:.2g} rad a second by its headings, by {said:.2g} by its angular velocities; "
            "are they in the unit that the header names?"
        )


def _size(windows: np.ndarray) -> float:
    """Root mean square of the lengths of (W, N)."""
    return float(np.sqrt(np.square(windows).sum(1).mean()))


def _windows(steps: np.ndarray) -> np.ndarray:
    """Sums (W, N) over successive windows of (K, N)."""
    count = len(steps) // WINDOW
    return steps[: count * WINDOW].reshape(count, WINDOW, -1).sum(1)


def _into_world(quaternions: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors (K, 3) of the frames of unit quaternions (K, 4) in that of the world."""
    axis, w = quaternions[:, :3], quaternions[:, 3:]
    twice = 2 * np.cross(axis, vectors)
    return vectors + w * twice + np.cross(axis, twice)
