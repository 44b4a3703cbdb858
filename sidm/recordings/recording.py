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

UNEVEN = 0.1  # of a step that the time between two rows may be off
NOT_UNIT = 1e-3  # that a quaternion's length may be off
BEYOND = 1e-3  # that an action may be beyond 1
ABOVE = 2.0  # m, between a robot and the ground under it, more is taken for a map of other ground
MISFIT = 0.5  # of the speed, between velocities and how positions change, more is taken for another frame


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
    steps = np.diff(time) * rate
    odd = np.flatnonzero(~(np.abs(steps - 1) <= UNEVEN))
    if odd.size:
        row = int(odd[0])
        raise RecordingError(
            f"{name}: row {row + 2} comes {steps[row] / rate:.4g} s after the row before, not {1 / rate:.4g} s; "
            "cut the recording there"
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
    under = height_at(ground.heights, states[:, 0], states[:, 1], ground.spacing)
    above = float(np.median(states[:, 2] - under))
    if abs(above) > ABOVE:
        raise RecordingError(f"{name}: the robot is {above:.2f} m above the ground (median); is it another map?")
    moved = np.diff(states[:, POSITION], axis=0) * RATE  # (K, 3) m/s, world
    velocity = states[:, TWIST][:, :3]
    mean = (velocity[1:] + velocity[:-1]) / 2
    misfit = np.linalg.norm(_into_body(states[:-1, QUATERNION], moved) - mean, axis=1)
    speed = np.sqrt(np.mean(np.square(moved).sum(1)))
    if np.sqrt(np.mean(misfit**2)) > max(MISFIT * speed, 0.1):
        raise RecordingError(
            f"{name}: velocities do not fit how positions change ({np.sqrt(np.mean(misfit**2)):.2f} m/s apart at "
            f"{speed:.2f} m/s); they must be in the body frame, x forward"
        )


def _into_body(quaternions: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """World vectors (K, 3) in the frames of unit quaternions (K, 4)."""
    axis, w = -quaternions[:, :3], quaternions[:, 3:]
    twice = 2 * np.cross(axis, vectors)
    return vectors + w * twice + np.cross(axis, twice)
