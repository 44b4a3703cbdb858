"""Read drives of a robot of any body, bring them to the body's rate, and check them.

States are interpolated at the body's rate. An action is the mean of the rows' actions
in its control step, or that of the last row before where the step has no row. A pose
that does not change for one or two rows while the robot moves before and after comes
from a slower sensor, and is interpolated as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from sidm.body import UNITS, Body, as_body
from sidm.drives import Drive
from sidm.recordings import checks, frames
from sidm.recordings.csv_file import heights_file, read_csv, write_csv
from sidm.recordings.npz_file import read_npz, write_npz
from sidm.recordings.table import RecordingError, Table

if TYPE_CHECKING:
    import pandas as pd

SUFFIXES = (".csv", ".csv.gz", ".npz")
MAX_REPEATS = 2  # rows in which a slower sensor's pose may repeat itself
MIN_STEPS = 8  # control steps of a drive


def read_drives(
    path: str | Path | Sequence[str | Path],
    body: Body | str | Path | Mapping[str, Any],
    topics: Sequence[str] = (),
    held: bool = False,
) -> list[Drive]:
    """Read the drives of a file or a ROS bag, or of all files of a folder.

    Args:
        path: of the file, the bag or the folder, or a sequence of such paths.
        body: the robot's body, the YAML file that describes it, or the mapping in such
            a file.
        topics: names of the topics to read from bags that have several of a kind; all
            unless given.
        held: whether to accept a column that never changes. A model can be tried with
            such drives, but cannot learn from them.

    Returns:
        The drives, at the body's rate and in SI units.

    Raises:
        RecordingError: there are no drives, or the first fault; one line that names
            file, place and fault.
        ConfigError: the body has a fault.

    Examples:
        >>> body = "recordings/skid_steer.yaml"
        >>> drives = sidm.read_drives("recordings/warthog.csv.gz", body)
        >>> len(drives), drives[0].states.shape
        (287, (20, 6))
    """
    body = as_body(body)
    paths = list(map(Path, [path] if isinstance(path, (str, Path)) else path))
    files = [file for given in paths for file in _files(given)]
    where = ", ".join(map(str, paths))
    drives = [
        drive
        for file in files
        for table in _tables(file, body, topics)
        for drive in drives_from_table(table, body)
    ]
    if not held:
        checks.refuse_constant(where, drives, body)
    frames.refuse_together(where, drives, body)
    return drives


def drives_from_frame(frame: pd.DataFrame, body: Body) -> list[Drive]:
    """Drives from a table in memory, with columns as in a CSV file, in SI units.

    Args:
        frame: a row for each time, with the columns `time`, s, and those of the body;
            `drive` or `session` too where there are several drives.
        body: the robot's body.

    Raises:
        RecordingError: a column is missing, or the first fault; the message is one
            line.
    """
    required = ["time", *(name for name, _ in (*body.state, *body.actions))]
    if missing := [name for name in required if name not in frame]:
        raise RecordingError(
            f"the table has no column '{missing[0]}'; "
            f"body '{body.name}' wants {', '.join(required)}"
        )
    columns = {name: frame[name].to_numpy(float) for name in required}
    labels = {
        name: frame[name].to_numpy(str)
        for name in ("drive", "session")
        if name in frame
    }
    return drives_from_table(Table("the table", columns, labels, None), body)


def _files(path: Path) -> list[Path]:
    """The path itself if it is a file or a bag, or the files of drives in a folder."""
    if not path.exists():
        raise RecordingError(f"{path}: there is no such file")
    if not path.is_dir() or is_bag(path):
        return [path]
    files = _files_in(path)
    if not files:
        raise RecordingError(
            f"{path}: no file of drives ({', '.join(SUFFIXES)}) "
            "and no ROS bag in this folder"
        )
    return files


def _files_in(folder: Path) -> list[Path]:
    """The files of drives in a folder, without the files of heights that they name."""
    files = sorted(
        file
        for file in folder.iterdir()
        if file.name.endswith(SUFFIXES) or is_bag(file)
    )
    named = [heights_file(file) for file in files if ".csv" in file.name]
    heights = {file.resolve() for file in named if file}
    return [file for file in files if file.resolve() not in heights]


def _tables(path: Path, body: Body, topics: Sequence[str]) -> Iterable[Table]:
    """The tables of a file or a bag."""
    if is_bag(path):
        from sidm.recordings.bags import read_bag  # its library is optional

        return [read_bag(path, body, topics)]
    if path.suffix == ".npz":
        return read_npz(path, body)
    if path.name.endswith(SUFFIXES):
        return [read_csv(path, body)]
    raise RecordingError(f"{path}: drives are {', '.join(SUFFIXES)} or ROS bags")


def is_bag(path: Path) -> bool:
    """Whether a path is a ROS bag: a file of ROS 1, or a folder of ROS 2."""
    folder = path.is_dir() and (path / "metadata.yaml").is_file()
    return path.suffix == ".bag" or folder


def drives_from_table(table: Table, body: Body) -> list[Drive]:
    """Drives from a table, at the body's rate; RecordingError names the first fault."""
    ground = table.ground and checks.whole_ground(table.name, table.ground)
    count = len(next(iter(table.columns.values())))
    no_labels = np.full(count, "")
    sessions, names = (table.labels.get(n, no_labels) for n in ("session", "drive"))
    changed = (sessions[1:] != sessions[:-1]) | (names[1:] != names[:-1])
    starts = np.flatnonzero(changed) + 1
    drives, recorded = [], []
    for number, rows in enumerate(np.split(np.arange(count), starts)):
        labels = (sessions[rows[0]], names[rows[0]]) if len(rows) else ()
        label = "/".join(filter(None, labels)) or str(number)
        where = f"{table.name}: drive {label}" if len(starts) else table.name
        columns = {name: values[rows] for name, values in table.columns.items()}
        if table.ground and body.pose_size:
            for name, middle in zip("xy", table.ground.centre, strict=True):
                columns[name] = columns[name] - middle
        rows_of_drive = _rows(where, columns, body, table.rate)
        recorded.append((rows_of_drive.states, 1 / rows_of_drive.spacing))
        states, actions = _resampled(rows_of_drive, body)
        if len(actions) < MIN_STEPS:
            raise RecordingError(
                f"{where}: {len(actions)} steps of {1 / body.rate:g} s; "
                f"a drive has {MIN_STEPS}"
            )
        actions = checks.within_limits(where, actions, body)
        frames.refuse_other_maps(where, states, ground, body)
        if checks.has_twist(body):
            frames.refuse_other_velocities(where, states, body)
        session = str(sessions[rows[0]] or f"{table.name} {label}")
        several = len(starts) or not table.labels
        name = f"{table.name} drive {label}" if several else table.name
        drives.append(Drive(states, actions, body, ground, name, session=session))
    checks.refuse_jumps(drives, body)
    if checks.has_twist(body):
        frames.refuse_other_turning(table.name, recorded)
    return drives


class _Rows(NamedTuple):
    """The recorded rows of one drive."""

    states: np.ndarray  # (R, S)
    actions: np.ndarray  # (R, A)
    time: np.ndarray  # (R,) s, from 0 on
    spacing: float  # s, median


def _rows(
    where: str, columns: Mapping[str, np.ndarray], body: Body, rate: float | None
) -> _Rows:
    """The rows of one drive; angles are unwrapped and quaternions have length 1."""
    states = np.stack([columns[name] for name, _ in body.state], 1)
    actions = np.stack([columns[name] for name, _ in body.actions], 1)
    time = np.arange(len(states)) / rate if rate else columns["time"]
    time = time - time[:1]
    checks.refuse_numbers(where, states, actions, body)
    spacing = checks.refuse_times(where, time)
    angles = [i for i, (_, unit) in enumerate(body.state) if unit in UNITS["angle"]]
    states[:, angles] = np.unwrap(states[:, angles], axis=0)
    if body.pose == "spatial":
        states[:, 3:7] = checks.unit_quaternions(where, states[:, 3:7])
    return _Rows(states, actions, time, spacing)


def _resampled(rows: _Rows, body: Body) -> tuple[np.ndarray, np.ndarray]:
    """States (K + 1, S) and actions (K, A) of one drive at the body's rate."""
    states, actions, time, spacing = rows
    grid = np.arange(0, time[-1] + 1e-6 * spacing, 1 / body.rate)
    # signs stay as they are where nothing is interpolated
    same = len(grid) == len(time) and np.allclose(grid, time)
    if body.pose == "spatial" and not same:
        states = states.copy()
        states[:, 3:7] *= _signs(states[:, 3:7])
    size = body.pose_size
    new = _new_poses(states[:, :size]) if size else np.ones(len(time), bool)
    pose = [np.interp(grid, time[new], column[new]) for column in states.T[:size]]
    others = [np.interp(grid, time, column) for column in states.T[size:]]
    resampled = np.stack([*pose, *others], 1)
    if body.pose == "spatial":
        resampled[:, 3:7] /= np.linalg.norm(resampled[:, 3:7], axis=1, keepdims=True)
    # the row whose action holds at each time of the grid
    held = np.searchsorted(time, grid + 1e-6 * spacing, side="right") - 1
    means = [
        actions[start : max(end, start + 1)].mean(0)
        for start, end in zip(held[:-1], held[1:], strict=True)
    ]
    return resampled, np.reshape(means, (len(grid) - 1, actions.shape[1]))


def _signs(quaternions: np.ndarray) -> np.ndarray:
    """Signs (R, 1) that bring each of quaternions (R, 4) nearer to the previous one."""
    opposite = (quaternions[1:] * quaternions[:-1]).sum(1) < 0
    return np.cumprod(np.r_[1.0, np.where(opposite, -1.0, 1.0)])[:, None]


def _new_poses(pose: np.ndarray) -> np.ndarray:
    """Which rows (R,) of a pose (R, P) a slower sensor has measured anew.

    The other rows repeat the row before, at most MAX_REPEATS times in a sequence.
    """
    moved = np.r_[True, (np.diff(pose, axis=0) != 0).any(1)]
    starts = np.flatnonzero(moved)
    lengths = np.diff(np.r_[starts, len(pose)])
    new = np.ones(len(pose), bool)
    for start, length in zip(starts, lengths, strict=True):
        if 1 < length <= 1 + MAX_REPEATS:
            new[start + 1 : start + length] = False
    return new


def write_drives(path: str | Path, drives: Sequence[Drive], origin: str) -> None:
    """Write drives to a file that `read_drives` reads.

    Args:
        path: of the file, .csv, .csv.gz or .npz; only .npz holds grounds as well.
        drives: of one robot.
        origin: where the drives come from, for people.

    Raises:
        ValueError: the kind of file is unknown or does not hold grounds, or there are
            no drives.
        OSError: the file cannot be written; the message is one line.
    """
    path = Path(path)
    if not drives:
        raise ValueError(f"{path}: there are no drives to write")
    body = drives[0].body
    if not path.name.endswith(SUFFIXES) or (body.map_size and path.suffix != ".npz"):
        kinds = ".npz" if body.map_size else ", ".join(SUFFIXES)
        raise ValueError(f"{path}: drives of body '{body.name}' are written as {kinds}")
    write = write_npz if path.suffix == ".npz" else write_csv
    write(path, drives, origin)
