"""A table of numbers as a recording, and what is wrong with one, row by row."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sidm.body import UNITS
from sidm.config import unknown_name
from sidm.recordings.frames import refuse_other_maps, refuse_other_rates, refuse_other_velocities
from sidm.recordings.recording import ACTION, COLUMNS, RATE, STATE, Ground, Recording, RecordingError
from sidm.trajectory import ACTION_SIZE, QUATERNION, STEPS

LATE = 0.5  # of a row, that a row's time may be off; a row that is missing is off by more
NOT_UNIT = 1e-3  # that a quaternion's length may be off
BEYOND = 1e-3  # that an action may be beyond 1


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
    steps = max(len(rows) - 1, 0) // stride
    if steps < STEPS:
        raise RecordingError(f"{name}: {steps} steps of 0.1 s, fewer than the {STEPS} of a trajectory")
    if "time" in table:
        _refuse_gaps(name, table["time"], rate)
    _refuse_ground(name, ground)
    states, actions = (np.stack([table[column] for column in some], axis=1) for some in (STATE, ACTION))
    _refuse_numbers(name, states, actions)
    states[:, QUATERNION] /= np.linalg.norm(states[:, QUATERNION], axis=1, keepdims=True)
    states[:, :2] -= ground.centre
    every, states = states, states[: steps * stride + 1 : stride]
    actions = actions[: steps * stride].reshape(steps, stride, ACTION_SIZE).mean(1)
    ground = ground._replace(heights=np.asarray(ground.heights, float), centre=(0.0, 0.0))
    refuse_other_maps(name, states, ground)
    refuse_other_velocities(name, states)
    refuse_other_rates(name, every, rate)
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
