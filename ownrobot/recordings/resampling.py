"""Rows of a table divided into drives and brought to the rate of control steps.

States are interpolated. An action is the mean of what is commanded in its control step,
where the action of a row holds until the next row; a row may be a little late. Angles
that stay within one turn are averaged around the circle. A pose that repeats itself
because its sensor is slower than the rows is interpolated as well.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from ownrobot.recordings import checks, frames
from ownrobot.recordings.table import Findings, RecordingError, Table, faults_of
from sidm.body import UNITS, Body, Columns
from sidm.drives import Drive, Ground

MAX_REPEATS = 2  # rows in which a slower sensor's pose may repeat itself, at least
MIN_STEPS = 8  # control steps of a drive
PLACES = 3  # pauses of a drive whose times a note tells
TURN = 2 * np.pi + 1e-6  # rad, a full turn and rounding
JITTER = 0.1  # of the rows' spacing, by which a row may be late for its step
FEWEST_CHANGES = 10  # of a pose, from which the rate of its sensor is known


class Rows(NamedTuple):
    """The recorded rows of one drive, or of what becomes several at its pauses."""

    where: str  # file and drive, for messages
    name: str
    session: str
    states: np.ndarray  # (R, S); angles are unwrapped, quaternions have length 1
    actions: np.ndarray  # (R, A)
    time: np.ndarray  # (R,) s, from 0 on
    spacing: float  # s, median


def rows_of_drives(table: Table, body: Body, findings: Findings) -> list[Rows]:
    """The rows of each drive of a table, as its labels divide it."""
    count = len(next(iter(table.columns.values())))
    no_labels = np.full(count, "")
    sessions, names = (table.labels.get(n, no_labels) for n in ("session", "drive"))
    changed = (sessions[1:] != sessions[:-1]) | (names[1:] != names[:-1])
    starts, found = np.flatnonzero(changed) + 1, []
    known: Counter[str] = Counter()
    for number, rows in enumerate(np.split(np.arange(count), starts)):
        labels = (sessions[rows[0]], names[rows[0]]) if len(rows) else ()
        label = "/".join(filter(None, labels)) or str(number)
        known[label] += 1
        if known[label] > 1:  # another drive with the same label
            label = f"{label}.{known[label]}"
        where = f"{table.name}: drive {label}" if len(starts) else table.name
        columns = {name: values[rows] for name, values in table.columns.items()}
        if table.ground and body.pose_size:
            for name, middle in zip("xy", table.ground.centre, strict=True):
                columns[name] = columns[name] - middle
        with findings.kept(where):
            numbers = _checked(columns, body, table.rate)
            session = str(sessions[rows[0]] or table.session or f"{table.name} {label}")
            several = len(starts) or not table.labels
            name = f"{table.name} drive {label}" if several else table.name
            found.append(Rows(where, name, session, *numbers))
    return found


def _checked(
    columns: Mapping[str, np.ndarray], body: Body, rate: float | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """States, actions, times and spacing of one drive, as in `Rows`."""
    states = np.stack([columns[name] for name, _ in body.state], 1)
    actions = np.stack([columns[name] for name, _ in body.actions], 1)
    time = np.arange(len(states)) / rate if rate else columns["time"]
    time = time - time[:1]
    checks.refuse_numbers(states, actions, body)
    spacing = checks.refuse_times(time)
    angles = _angles(body.state)
    for column in angles:
        checks.refuse_angles(body.state[column][0], states[:, column])
    yaw = [column for column in angles if column < body.pose_size]
    turning = {*yaw, *_within_a_turn(states, angles)}
    for column in turning:
        states[:, column] = np.unwrap(states[:, column])
    if body.pose == "spatial":
        states[:, 3:7] = checks.unit_quaternions(states[:, 3:7])
    return states, actions, time, spacing


def _angles(columns: Columns) -> list[int]:
    """Numbers of the columns that are angles."""
    return [n for n, (_, unit) in enumerate(columns) if unit in UNITS["angle"]]


def _within_a_turn(values: np.ndarray, angles: list[int]) -> list[int]:
    """The angles whose values (R, C) may wrap; a motor's turns add up."""
    return [n for n in angles if np.ptp(values[:, n]) <= TURN]


def drives_of_rows(
    rows: Rows, body: Body, ground: Ground | None, findings: Findings
) -> list[Drive]:
    """Drives from the rows of one, a drive for each piece between its pauses."""
    starts = checks.pauses(rows.time, body.rate)
    pieces = (np.split(part, starts) for part in (rows.states, rows.actions, rows.time))
    parts = [
        resampled(states, actions, time - time[0], rows.spacing, body)
        for states, actions, time in zip(*pieces, strict=True)
    ]
    long = [part for part in parts if len(part[1]) >= MIN_STEPS]
    if not long:
        what = f"between its {len(starts)} pauses, " if len(starts) else ""
        steps = max(len(actions) for _, actions in parts)
        raise RecordingError(
            f"{what}{steps} steps of {1 / body.rate:g} s; "
            f"a drive has {MIN_STEPS} or more: leave it out"
        )
    if len(starts):
        places = [f"{rows.time[row - 1]:.4g} s" for row in starts[:PLACES]]
        places += ["..."] if len(starts) > PLACES else []
        count = "1 pause" if len(starts) == 1 else f"{len(starts)} pauses"
        short = len(parts) - len(long)
        findings.notes.append(
            f"{rows.where}: {count} ({', '.join(places)} after its start): "
            f"{len(parts)} drives are made of it"
            + (f"; {short} shorter than {MIN_STEPS} steps left out" if short else "")
        )
    drives = []
    for number, (states, actions) in enumerate(long, start=1):
        part = f" part {number}" if len(starts) else ""
        with faults_of(rows.where + part):
            actions = checks.within_limits(actions, body)
            frames.refuse_other_maps(states, ground, body)
            if checks.has_twist(body):
                frames.refuse_other_velocities(states, body)
        name = rows.name + part
        drives.append(Drive(states, actions, body, ground, name, session=rows.session))
    return drives


def resampled(
    states: np.ndarray,
    actions: np.ndarray,
    time: np.ndarray,
    spacing: float,
    body: Body,
) -> tuple[np.ndarray, np.ndarray]:
    """States (K + 1, S) and actions (K, A) at the body's rate, from those of `Rows`."""
    grid = np.arange(0, time[-1] + 1e-6 * spacing, 1 / body.rate)
    # signs stay as they are where nothing is interpolated
    same = len(grid) == len(time) and np.allclose(grid, time)
    if body.pose == "spatial" and not same:
        states = states.copy()
        opposite = (states[1:, 3:7] * states[:-1, 3:7]).sum(1) < 0
        signs = np.cumprod(np.r_[1.0, np.where(opposite, -1.0, 1.0)])
        states[:, 3:7] *= signs[:, None]
    size = body.pose_size
    new = _new_poses(states[:, :size], time, spacing)
    pose = [np.interp(grid, time[new], column[new]) for column in states.T[:size]]
    others = [np.interp(grid, time, column) for column in states.T[size:]]
    at_rate = np.stack([*pose, *others], 1)
    if body.pose == "spatial":
        at_rate[:, 3:7] /= np.linalg.norm(at_rate[:, 3:7], axis=1, keepdims=True)
    angles = _within_a_turn(actions, _angles(body.actions))
    return at_rate, _means(actions, time, grid, JITTER * spacing, angles)


def _means(
    actions: np.ndarray,
    time: np.ndarray,
    grid: np.ndarray,
    late: float,
    angles: list[int],
) -> np.ndarray:
    """Means (K, A) of actions (R, A), each held to the next row, between grid times.

    A row that is so `late`, s, or less for a time of the grid counts from there on.
    """
    first = np.searchsorted(time, grid + late, side="right") - 1
    on_grid = np.abs(time[first] - grid) <= late
    whole = on_grid[:-1] & on_grid[1:]  # steps of whole rows, which count alike
    last = np.searchsorted(time, grid[1:] - late, side="left") - 1
    first, last = first[:-1], np.maximum(last, first[:-1])
    counts, means = last - first + 1, np.empty((len(first), actions.shape[1]))
    for count in np.unique(counts):  # steps of as many rows are taken together
        steps = np.flatnonzero(counts == count)
        rows = first[steps, None] + np.arange(count)  # (steps, count)
        parts = actions[rows]  # (steps, count, A)
        parts[..., angles] = np.unwrap(parts[..., angles], axis=1)
        ends = np.column_stack([grid[steps], time[rows[:, 1:]], grid[steps + 1]])
        shares = np.diff(ends, axis=1) / (ends[:, -1:] - ends[:, :1])
        weighted = (parts * shares[..., None]).sum(1)
        means[steps] = np.where(whole[steps, None], parts.mean(1), weighted)
    return means


def pose_rate(drives: Iterable[tuple[np.ndarray, np.ndarray]]) -> float | None:
    """New poses a second, Hz, of drives' times, s, and poses; None if few."""
    spacings = [np.diff(time[_changes(pose)]) for time, pose in drives]
    together = np.concatenate([np.zeros(0), *spacings])
    return None if len(together) < FEWEST_CHANGES else float(1 / np.median(together))


def _changes(pose: np.ndarray) -> np.ndarray:
    """Numbers of the rows of a pose (R, P) that differ from the row before."""
    return np.flatnonzero((np.diff(pose, axis=0) != 0).any(1)) + 1


def _new_poses(pose: np.ndarray, time: np.ndarray, spacing: float) -> np.ndarray:
    """Which rows (R,) a slower sensor of the pose (R, P) has measured anew.

    The other rows repeat the row before, as often as the sensor's rate asks for and at
    least up to MAX_REPEATS times. Where a pose repeats itself longer, the robot stands.
    """
    rate = pose_rate([(time, pose)])
    usual = 0 if rate is None else round(1 / (rate * spacing))
    repeats = usual if usual > MAX_REPEATS + 1 else MAX_REPEATS
    starts = np.r_[0, _changes(pose)]
    lengths = np.diff(np.r_[starts, len(pose)])
    new = np.ones(len(pose), bool)
    for start, length in zip(starts, lengths, strict=True):
        if 1 < length <= 1 + repeats:
            new[start + 1 : start + length] = False
    return new
