"""Rows of a table divided into drives and brought to the rate of control steps.

States are interpolated. An action is the mean of the rows' actions in its control step,
or that of the last row before where the step has no row; a row may be a little late.
Angles are averaged around the circle. A pose that repeats itself
because its sensor is slower than the rows is interpolated as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ownrobot.recordings import checks, frames
from ownrobot.recordings.table import Findings, RecordingError, Table
from sidm.body import UNITS, Body
from sidm.drives import Drive, Ground

MAX_REPEATS = 2  # rows in which a slower sensor's pose may repeat itself, at least
MIN_STEPS = 8  # control steps of a drive
PLACES = 3  # pauses of a drive whose times a note tells
JITTER = 0.1  # of the rows' spacing, by which a row may be late for its step
FEWEST_CHANGES = 10  # of a pose, from which the rate of its sensor is known


class Rows(NamedTuple):
    """The recorded rows of one drive."""

    states: np.ndarray  # (R, S)
    actions: np.ndarray  # (R, A)
    time: np.ndarray  # (R,) s, from 0 on
    spacing: float  # s, median


class Recorded(NamedTuple):
    """One drive of a table, or what is to become several at its pauses."""

    where: str  # file and drive, for messages
    name: str
    session: str
    rows: Rows


def recorded_drives(table: Table, body: Body, findings: Findings) -> Iterable[Recorded]:
    """The drives of a table, as its labels divide it."""
    count = len(next(iter(table.columns.values())))
    no_labels = np.full(count, "")
    sessions, names = (table.labels.get(n, no_labels) for n in ("session", "drive"))
    changed = (sessions[1:] != sessions[:-1]) | (names[1:] != names[:-1])
    starts = np.flatnonzero(changed) + 1
    for number, rows in enumerate(np.split(np.arange(count), starts)):
        labels = (sessions[rows[0]], names[rows[0]]) if len(rows) else ()
        label = "/".join(filter(None, labels)) or str(number)
        where = f"{table.name}: drive {label}" if len(starts) else table.name
        columns = {name: values[rows] for name, values in table.columns.items()}
        if table.ground and body.pose_size:
            for name, middle in zip("xy", table.ground.centre, strict=True):
                columns[name] = columns[name] - middle
        try:
            numbers = rows_of(where, columns, body, table.rate)
        except RecordingError as error:
            findings.add(error)
            continue
        session = str(sessions[rows[0]] or table.session or f"{table.name} {label}")
        several = len(starts) or not table.labels
        name = f"{table.name} drive {label}" if several else table.name
        yield Recorded(where, name, session, numbers)


def drives_of_pieces(
    recorded: Recorded, body: Body, ground: Ground | None, findings: Findings
) -> list[Drive]:
    """Drives from the rows of one, a drive for each piece between its pauses."""
    parts = [resampled(part, body) for part in pieces(recorded.rows, body.rate)]
    long = [part for part in parts if len(part[1]) >= MIN_STEPS]
    if not long:
        what = f"between its {len(parts) - 1} pauses, " if len(parts) > 1 else ""
        steps = max(len(actions) for _, actions in parts)
        raise RecordingError(
            f"{recorded.where}: {what}{steps} steps of {1 / body.rate:g} s; "
            f"a drive has {MIN_STEPS} or more: leave it out"
        )
    if len(parts) > 1:
        findings.notes.append(_pause_text(recorded, len(parts), len(long), body))
    drives = []
    for number, (states, actions) in enumerate(long, start=1):
        part = f" part {number}" if len(parts) > 1 else ""
        where = f"{recorded.where}{part}"
        actions = checks.within_limits(where, actions, body)
        frames.refuse_other_maps(where, states, ground, body)
        if checks.has_twist(body):
            frames.refuse_other_velocities(where, states, body)
        name, session = recorded.name + part, recorded.session
        drives.append(Drive(states, actions, body, ground, name, session=session))
    return drives


def _pause_text(recorded: Recorded, parts: int, kept: int, body: Body) -> str:
    """The note about a recording that pauses."""
    time = recorded.rows.time
    starts = checks.pauses(time, body.rate)
    places = [f"{time[row - 1]:.4g} s" for row in starts[:PLACES]]
    places += ["..."] if len(starts) > PLACES else []
    short = f"; {parts - kept} shorter than {MIN_STEPS} steps left out"
    count = "1 pause" if len(starts) == 1 else f"{len(starts)} pauses"
    return (
        f"{recorded.where}: {count} ({', '.join(places)} after its start): {parts} "
        "drives are made of it" + (short if kept < parts else "")
    )


def rows_of(
    where: str, columns: Mapping[str, np.ndarray], body: Body, rate: float | None
) -> Rows:
    """The rows of one drive; angles are unwrapped and quaternions have length 1.

    Columns (R,) are in SI units; without a rate, Hz, they have the column `time`.
    """
    states = np.stack([columns[name] for name, _ in body.state], 1)
    actions = np.stack([columns[name] for name, _ in body.actions], 1)
    time = np.arange(len(states)) / rate if rate else columns["time"]
    time = time - time[:1]
    checks.refuse_numbers(where, states, actions, body)
    spacing = checks.refuse_times(where, time)
    angles = [i for i, (_, unit) in enumerate(body.state) if unit in UNITS["angle"]]
    for column in angles:
        checks.refuse_angles(where, body.state[column][0], states[:, column])
    states[:, angles] = np.unwrap(states[:, angles], axis=0)
    if body.pose == "spatial":
        states[:, 3:7] = checks.unit_quaternions(where, states[:, 3:7])
    return Rows(states, actions, time, spacing)


def pieces(rows: Rows, rate: float) -> list[Rows]:
    """The rows between the pauses of a recording; times begin at 0 in each piece."""
    starts = checks.pauses(rows.time, rate)
    if not starts.size:
        return [rows]
    parts = (np.split(values, starts) for values in rows[:3])
    return [
        Rows(states, actions, time - time[0], rows.spacing)
        for states, actions, time in zip(*parts, strict=True)
    ]


def resampled(rows: Rows, body: Body) -> tuple[np.ndarray, np.ndarray]:
    """States (K + 1, S) and actions (K, A) of one drive at the body's rate."""
    states, actions, time, spacing = rows
    grid = np.arange(0, time[-1] + 1e-6 * spacing, 1 / body.rate)
    # signs stay as they are where nothing is interpolated
    same = len(grid) == len(time) and np.allclose(grid, time)
    if body.pose == "spatial" and not same:
        states = states.copy()
        states[:, 3:7] *= _signs(states[:, 3:7])
    size = body.pose_size
    new = _new_poses(rows, size) if size else np.ones(len(time), bool)
    pose = [np.interp(grid, time[new], column[new]) for column in states.T[:size]]
    others = [np.interp(grid, time, column) for column in states.T[size:]]
    at_rate = np.stack([*pose, *others], 1)
    if body.pose == "spatial":
        at_rate[:, 3:7] /= np.linalg.norm(at_rate[:, 3:7], axis=1, keepdims=True)
    # the row whose action holds at each time of the grid
    held = np.searchsorted(time, grid + JITTER * spacing, side="right") - 1
    return at_rate, _means(actions, held, body)


def _means(actions: np.ndarray, held: np.ndarray, body: Body) -> np.ndarray:
    """Means (K, A) of actions (R, A) from each of the rows `held` (K + 1,) to the next.

    A row that is held twice is a step's action alone.
    """
    angles = [i for i, (_, unit) in enumerate(body.actions) if unit in UNITS["angle"]]
    counts = np.maximum(np.diff(held), 1)
    means = np.empty((len(counts), actions.shape[1]))
    for count in np.unique(counts):  # steps of as many rows are taken together
        steps = np.flatnonzero(counts == count)
        parts = actions[held[steps, None] + np.arange(count)]  # (steps, count, A)
        parts[..., angles] = np.unwrap(parts[..., angles], axis=1)
        means[steps] = parts.mean(1)
    return means


def _signs(quaternions: np.ndarray) -> np.ndarray:
    """Signs (R, 1) that bring each of quaternions (R, 4) nearer to the previous one."""
    opposite = (quaternions[1:] * quaternions[:-1]).sum(1) < 0
    return np.cumprod(np.r_[1.0, np.where(opposite, -1.0, 1.0)])[:, None]


def pose_rate(drives: Sequence[Rows], size: int) -> float | None:
    """New values of the pose a second, Hz, in the median of all drives' rows.

    None where the pose, of `size` numbers, changes too rarely to tell.
    """
    spacings = [
        np.diff(rows.time[_changes(rows.states[:, :size])]) for rows in drives if size
    ]
    together = np.concatenate([np.zeros(0), *spacings])
    return None if len(together) < FEWEST_CHANGES else float(1 / np.median(together))


def _changes(pose: np.ndarray) -> np.ndarray:
    """Numbers of the rows of a pose (R, P) that differ from the row before."""
    return np.flatnonzero((np.diff(pose, axis=0) != 0).any(1)) + 1


def _new_poses(rows: Rows, size: int) -> np.ndarray:
    """Which rows (R,) a slower sensor of the pose has measured anew.

    The other rows repeat the row before, as often as the sensor's rate asks for and at
    least up to MAX_REPEATS times. Where a pose repeats itself longer, the robot stands.
    """
    rate = pose_rate([rows], size)
    usual = 0 if rate is None else round(1 / (rate * rows.spacing))
    repeats = usual if usual > MAX_REPEATS + 1 else MAX_REPEATS
    starts = np.r_[0, _changes(rows.states[:, :size])]
    lengths = np.diff(np.r_[starts, len(rows.states)])
    new = np.ones(len(rows.states), bool)
    for start, length in zip(starts, lengths, strict=True):
        if 1 < length <= 1 + repeats:
            new[start + 1 : start + length] = False
    return new
