"""Drives of a robot of any body: a table of numbers, by its own columns, brought to the body's rate.

A file is CSV, may be compressed (`.csv.gz`), and begins with lines `# name: value` of HEADER; the names of the columns
follow, units in brackets:

    # rate: 20 Hz
    drive,x [m],y [m],yaw [deg],yaw_rate [rad/s],left [rad/s],right [rad/s]

Columns are those of the body's state and actions, in any order and any unit of their kind; those that no body names are
left out. Three more may be there: `time`, in place of a rate, `drive`, which changes where another drive begins, and
`session`, whose drives belong together and are never parted between learning and judging.

What lies between two rows of the body's rate is interpolated; of rows closer together than that, actions are the mean
up to the next. A pose that stands still for one or two rows while the robot moves before and after is that of a slower
sensor, and is interpolated as well.
"""

from __future__ import annotations

import csv
import gzip
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sidm.body import UNITS, Body
from sidm.config import unknown_name
from sidm.recordings.recording import RecordingError

HEADER = {"rate": "rows a second, Hz", "origin": "where the drives are from, for people"}
SUFFIXES = (".csv", ".csv.gz")
EXTRA = ("time", "drive", "session")
GAP = 3.0  # median spacings between two rows: more is a gap
STILL = 2  # rows, at most, that a slower sensor's pose repeats itself
JUMP, FASTER = 1.0, 5.0  # m in a step, and times the 90th percentile of the file: more of both is no driving
FEWEST_STEPS = 8  # of a drive
SLOW_TURN, SLOW = 0.05, 0.05  # rad/s and m/s, root mean squares: less is too little motion to judge columns by
OFF = 1.7  # times as much motion as a column says, or as little, is taken for another unit


class Drive(NamedTuple):
    """K control steps of a robot, at its body's rate, in SI units."""

    name: str  # for messages
    session: str  # drives of one session belong together
    states: np.ndarray  # (K + 1, S) float64
    actions: np.ndarray  # (K, A) float64


class Table(NamedTuple):
    """Rows of numbers by the names of their columns, in SI units."""

    name: str  # of the file, for messages
    columns: dict[str, np.ndarray]  # (R,) each
    labels: dict[str, np.ndarray]  # (R,) of text: drive and session, where they are
    rate: float | None  # Hz, where there is no time


def read_drives(path: str | Path, body: Body) -> list[Drive]:
    """The drives of a file, or of all files of a folder.

    Raises:
        RecordingError: there are none, or the first fault; one line that names file, place and fault.
    """
    path = Path(path)
    if not path.exists():
        raise RecordingError(f"{path}: there is no such file")
    files = sorted(file for file in path.iterdir() if is_drives(file)) if path.is_dir() and not is_bag(path) else [path]
    if not files:
        raise RecordingError(f"{path}: no file of drives ({', '.join(SUFFIXES)}) and no ROS bag in this folder")
    found = [drive for file in files for drive in drives_of(_table(file, body), body)]
    refuse_constant(str(path), found, body)
    refuse_other_rates(str(path), found, body)
    return found


def is_drives(path: Path) -> bool:
    """Whether a file or folder is one of drives, by its name."""
    return path.name.endswith(SUFFIXES) or is_bag(path)


def _table(path: Path, body: Body) -> Table:
    if is_bag(path):
        from sidm.recordings.bags import read_bag  # whose library not everyone has

        return read_bag(path, body)
    if path.name.endswith(SUFFIXES):
        return read_table(path, body)
    raise RecordingError(f"{path}: drives are {', '.join(SUFFIXES)} or ROS bags")


def is_bag(path: Path) -> bool:
    """Whether a path is a ROS bag: a file of ROS 1, or a folder of ROS 2."""
    return path.suffix == ".bag" or (path.is_dir() and (path / "metadata.yaml").is_file())


def read_table(path: Path, body: Body) -> Table:
    """The rows of a file that a body names; RecordingError names the first fault."""
    lines = _lines(path)
    first = next((number for number, line in enumerate(lines) if not line.startswith("#")), len(lines))
    header = _header(path, lines[:first])
    rows = list(csv.reader(lines[first:]))
    if not rows or len(rows) < 3:
        raise RecordingError(f"{path}: it has no rows of numbers")
    named = [re.fullmatch(r"\s*(.*?)\s*(?:\[(.*)\])?\s*", cell) for cell in rows[0]]
    names, units = [match[1] for match in named if match], [(match[2] or "").strip() for match in named if match]
    wanted = dict((*body.state, *body.actions))
    for name in (*wanted, *(["time"] if "rate" not in header else [])):
        if name not in names:
            hint = str(unknown_name(name, names, "the file")).partition("; ")[2]
            raise RecordingError(f"{path}: column '{name}' of body '{body.name}' is missing; {hint}")
    for name in (*wanted, *EXTRA):
        if names.count(name) > 1:
            raise RecordingError(f"{path}: two columns '{name}'")
    for number, row in enumerate(rows[1:], start=first + 2):
        if len(row) != len(names):
            raise RecordingError(f"{path}: line {number} has {len(row)} cells, not {len(names)}")
    cells = dict(zip(names, zip(*rows[1:], strict=True), strict=True))
    scale = {name: _scale(path, name, units[names.index(name)], wanted.get(name, "s")) for name in wanted}
    if "time" in names:
        scale["time"] = _scale(path, "time", units[names.index("time")], "s")
    columns = {name: _numbers(path, name, cells[name], first + 2) * factor for name, factor in scale.items()}
    labels = {name: np.array(cells[name]) for name in ("drive", "session") if name in names}
    return Table(str(path), columns, labels, _rate(path, header) if "time" not in columns else None)


def _lines(path: Path) -> list[str]:
    try:
        if path.suffix == ".gz":
            with gzip.open(path, "rt", encoding="utf-8-sig") as file:
                return file.read().splitlines()
        return path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, EOFError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: cannot be read as text ({error})") from None


def _header(path: Path, lines: Sequence[str]) -> dict[str, str]:
    header = {}
    for line in lines:
        name, colon, value = line.lstrip("#").partition(":")
        if not colon:
            raise RecordingError(f"{path}: '{line}' in the header is not '# name: value'")
        if name.strip() not in HEADER:
            raise RecordingError(f"{path}: {unknown_name(name.strip(), HEADER, 'the header')}")
        header[name.strip()] = value.strip()
    return header


def _rate(path: Path, header: Mapping[str, str]) -> float:
    try:
        rate = float(header["rate"].removesuffix("Hz"))
    except ValueError:
        rate = float("nan")
    if not 0 < rate < float("inf"):
        raise RecordingError(f"{path}: 'rate: {header['rate']}' is not a positive number in Hz")
    return rate


def _scale(path: Path, name: str, unit: str, wanted: str) -> float:
    """Times which numbers of a column in `unit` are in the SI unit of the kind that `wanted` is of."""
    kind = next(kind for kind, units in UNITS.items() if wanted in units)
    unit = unit or ("1" if kind == "number" else "")
    if unit not in UNITS[kind]:
        shown = f"in '{unit}'" if unit else "without a unit"
        raise RecordingError(f"{path}: '{name}' {shown}; {_article(kind)} is in {' or '.join(UNITS[kind])}")
    return UNITS[kind][unit]


def _article(kind: str) -> str:
    return f"an {kind}" if kind[0] in "aeiou" else f"a {kind}"


def _numbers(path: Path, name: str, cells: Sequence[str], first: int) -> np.ndarray:
    """A column; `first` is the number of its first line."""
    try:
        values = np.array(cells, float)
    except ValueError:
        number, cell = next((n, cell) for n, cell in enumerate(cells) if not _is_number(cell))
        raise RecordingError(f"{path}: line {first + number}: '{cell}' of '{name}' is no number") from None
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise RecordingError(f"{path}: line {first + bad[0]}: '{name}' is not finite")
    return values


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def drives_of(table: Table, body: Body) -> list[Drive]:
    """A table's drives at the body's rate; RecordingError where times, poses or lengths are not those of driving."""
    count = len(next(iter(table.columns.values())))
    session, drive = (table.labels.get(name, np.full(count, "")) for name in ("session", "drive"))
    changes = np.flatnonzero((session[1:] != session[:-1]) | (drive[1:] != drive[:-1])) + 1
    found = []
    for number, rows in enumerate(np.split(np.arange(count), changes)):
        label = "/".join(filter(None, (session[rows[0]], drive[rows[0]]))) or str(number)
        where = f"{table.name}: drive {label}" if len(changes) else table.name
        part = {name: values[rows] for name, values in table.columns.items()}
        states, actions = _resampled(where, part, body, table.rate)
        if len(actions) < FEWEST_STEPS:
            raise RecordingError(f"{where}: {len(actions)} steps of {1 / body.rate:g} s; a drive has {FEWEST_STEPS}")
        belongs = str(session[rows[0]] or f"{table.name} {label}")
        found.append(Drive(f"{table.name} drive {label}", belongs, states, actions))
    _refuse_jumps(table.name, found, body)
    return found


def _resampled(
    where: str, part: Mapping[str, np.ndarray], body: Body, rate: float | None
) -> tuple[np.ndarray, np.ndarray]:
    """States (K + 1, S) and actions (K, A) of one drive at the body's rate."""
    states = np.stack([part[name] for name, _ in body.state], 1)
    actions = np.stack([part[name] for name, _ in body.actions], 1)
    time = np.arange(len(states)) / rate if rate else part["time"] - part["time"][0]
    spacing = _refuse_times(where, time)
    grid = np.arange(0, time[-1] + 1e-6 * spacing, 1 / body.rate)
    angles = [number for number, (_, unit) in enumerate(body.state) if unit in UNITS["angle"]]
    states[:, angles] = np.unwrap(states[:, angles], axis=0)
    size = body.pose_size
    fresh = _fresh(states[:, :size]) if size else np.ones(len(time), bool)
    new = np.stack(
        [np.interp(grid, *((time[fresh], one[fresh]) if number < size else (time, one)))
         for number, one in enumerate(states.T)], 1,
    )  # fmt: skip
    if body.pose == "spatial":
        new[:, 3:7] = _quaternions(where, states[:, 3:7], new[:, 3:7])
    held = np.searchsorted(time, grid + 1e-6 * spacing, side="right") - 1  # the row whose action holds at each time
    means = [actions[a : max(b, a + 1)].mean(0) for a, b in zip(held[:-1], held[1:], strict=True)]
    return new, np.reshape(means, (len(grid) - 1, actions.shape[1]))


def _refuse_times(where: str, time: np.ndarray) -> float:
    """The median spacing of the rows, s; RecordingError for times that do not grow or leave a gap."""
    steps = np.diff(time)
    if not len(steps):
        raise RecordingError(f"{where}: a single row is no drive")
    back = np.flatnonzero(steps <= 0)
    if back.size:
        row = int(back[0])
        what = "the same time as" if steps[row] == 0 else f"{-steps[row]:.4g} s before"
        raise RecordingError(f"{where}: row {row + 2} has {what} the row before it; sort the rows, each time once")
    spacing = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP * spacing)
    if gaps.size:
        row = int(gaps[0])
        raise RecordingError(
            f"{where}: row {row + 2} comes {steps[row]:.4g} s after the row before, where rows are {spacing:.4g} s "
            "apart; make two drives of it there"
        )
    return spacing


def _fresh(pose: np.ndarray) -> np.ndarray:
    """Which rows (R,) of a pose (R, P) are new: not those where it stands still for at most STILL rows amid motion."""
    moved = np.r_[True, (np.diff(pose, axis=0) != 0).any(1)]
    starts = np.flatnonzero(moved)
    lengths = np.diff(np.r_[starts, len(pose)])
    fresh = np.ones(len(pose), bool)
    for start, length in zip(starts, lengths, strict=True):
        if 1 < length <= 1 + STILL:
            fresh[start + 1 : start + length] = False
    return fresh


def _quaternions(where: str, given: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Interpolated ones (K + 1, 4) at unit length; RecordingError for what is no unit quaternion."""
    length = np.linalg.norm(given, axis=1)
    off = np.flatnonzero(np.abs(length - 1) > 1e-3)
    if off.size:
        raise RecordingError(f"{where}: the quaternion in row {off[0] + 1} has length {length[off[0]]:.4g}, not 1")
    return new / np.linalg.norm(new, axis=1, keepdims=True)


def _refuse_jumps(name: str, drives: Sequence[Drive], body: Body) -> None:
    """RecordingError where a robot is suddenly elsewhere."""
    if body.pose == "none":
        return
    steps = [np.linalg.norm(np.diff(drive.states[:, :2], axis=0), axis=1) for drive in drives]
    most = max(JUMP, FASTER * float(np.quantile(np.concatenate(steps), 0.9)))
    for drive, step in zip(drives, steps, strict=True):
        far = np.flatnonzero(step > most)
        if far.size:
            raise RecordingError(
                f"{drive.name}: {(far[0] + 1) / body.rate:.4g} s after its start the robot is {step[far[0]]:.3g} m "
                "farther within one step; make two drives of it there"
            )


def refuse_constant(name: str, drives: Sequence[Drive], body: Body) -> None:
    """RecordingError naming the first column that never changes in any drive, as a dead sensor's does not."""
    for kind, columns in (("states", body.state[body.pose_size :]), ("actions", body.actions)):
        values = np.concatenate([getattr(drive, kind)[:, -len(columns) :] for drive in drives]) if columns else None
        for number, (column, _) in enumerate(columns):
            assert values is not None
            if np.ptp(values[:, number]) == 0:
                raise RecordingError(f"{name}: '{column}' never changes; mend it, or leave it out of the body")


def refuse_other_rates(name: str, drives: Sequence[Drive], body: Body) -> None:
    """RecordingError where a yaw rate or a forward velocity is not that of the poses: another sign, unit or frame."""
    if body.pose == "none":
        return
    names = [column for column, _ in body.columns]
    moved_all = [_motion(drive, body) for drive in drives]
    heading, forward = (np.concatenate(parts) for parts in zip(*moved_all, strict=True))
    for column, moved, least in (("yaw_rate", heading, SLOW_TURN), ("wz", heading, SLOW_TURN), ("vx", forward, SLOW)):
        if column not in names:
            continue
        number = body.pose_size + names.index(column)
        told = np.concatenate([(drive.states[1:, number] + drive.states[:-1, number]) / 2 for drive in drives])
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
        x, y, z, w = states[:, 3:7].T
        yaw = np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2)))
    way = np.diff(states[:, :2], axis=0) * body.rate
    return np.diff(yaw) * body.rate, way[:, 0] * np.cos(yaw[:-1]) + way[:, 1] * np.sin(yaw[:-1])


def write_drives(path: str | Path, drives: Sequence[Drive], body: Body, origin: str) -> None:
    """Write drives as a file that `read_drives` reads, compressed where its name ends in .gz."""
    from sidm.storage import write_atomically

    columns = [f"{name} [{unit}]" for name, unit in (*body.state, *body.actions)]
    lines = [f"# origin: {origin}", f"# rate: {body.rate:g} Hz", ",".join(["session", "drive", *columns])]
    for number, drive in enumerate(drives):
        actions = np.vstack([drive.actions, drive.actions[-1:]])
        for row in np.hstack([drive.states, actions]):
            lines.append(",".join([drive.session, str(number), *(f"{value:.5g}" for value in row)]))
    text = ("\n".join(lines) + "\n").encode()
    packed = gzip.compress(text, mtime=0) if str(path).endswith(".gz") else text
    write_atomically(Path(path), lambda file: file.write(packed))
