"""Drives of a robot of any body: read from files or ROS bags, brought to the body's rate, and checked.

What lies between two rows of the body's rate is interpolated; of rows closer together
than that, actions are the mean up to the next. A pose that stands still for one or two
rows while the robot moves before and after is that of a slower sensor, and is
interpolated as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sidm.body import UNITS, Body, as_body
from sidm.drives import Drive
from sidm.recordings import checks
from sidm.recordings.csv_file import heights_file, read_csv, write_csv
from sidm.recordings.npz_file import read_npz, write_npz
from sidm.recordings.table import RecordingError, Table

if TYPE_CHECKING:
    import pandas as pd

SUFFIXES = (".csv", ".csv.gz", ".npz")
STILL = 2  # rows, at most, that a slower sensor's pose repeats itself
FEWEST_STEPS = 8  # of a drive


def read_drives(
    path: str | Path | Sequence[str | Path],
    body: Body | str | Path | Mapping[str, Any],
    topics: Sequence[str] = (),
    held: bool = False,
) -> list[Drive]:
    """The drives of a file or a ROS bag, or of all files of a folder.

    Args:
        path: of the file, the bag or the folder, or several of them.
        body: what the drives are made of: a body, the YAML file that describes it, or
            the mapping in such a file.
        topics: of bags that are read, where several could be meant; all unless given.
        held: whether a column may never change, as where a model is only tried; what
            learns needs it to.

    Returns:
        The drives, at the body's rate and in SI units.

    Raises:
        RecordingError: there are none, or the first fault; one line that names file,
            place and fault.
        ConfigError: the body has a fault.

    Examples:
        >>> drives = sidm.read_drives("recordings/warthog.csv.gz", body="recordings/skid_steer.yaml")
        >>> len(drives), drives[0].states.shape
        (287, (20, 6))
    """
    body = as_body(body)
    paths = [Path(one) for one in ([path] if isinstance(path, (str, Path)) else path)]
    files = [file for one in paths for file in _files(one)]
    where = ", ".join(map(str, paths))
    found = [
        drive
        for file in files
        for table in _tables(file, body, topics)
        for drive in drives_of(table, body)
    ]
    if not held:
        checks.refuse_constant(where, found, body)
    checks.refuse_together(where, found, body)
    return found


def drives_from_frame(frame: pd.DataFrame, body: Body) -> list[Drive]:
    """The drives of a table that is in memory: columns as in a CSV file, in SI units.

    Args:
        frame: a row a moment; `time`, s, and the body's columns, and where there are
            several drives `drive` or `session`.
        body: what the drives are made of.

    Raises:
        RecordingError: a column is missing, or the first fault; one line.
    """
    wanted = [name for name, _ in (*body.state, *body.actions)]
    if missing := [name for name in ("time", *wanted) if name not in frame]:
        names = ", ".join(wanted)
        raise RecordingError(
            f"the table has no column '{missing[0]}'; body '{body.name}' wants time, {names}"
        )
    columns = {name: frame[name].to_numpy(float) for name in ("time", *wanted)}
    labels = {
        name: frame[name].to_numpy(str)
        for name in ("drive", "session")
        if name in frame
    }
    return drives_of(Table("the table", columns, labels, None), body)


def _files(path: Path) -> list[Path]:
    """A file or a bag itself, or the files of drives in a folder."""
    if not path.exists():
        raise RecordingError(f"{path}: there is no such file")
    if not path.is_dir() or is_bag(path):
        return [path]
    files = _inside(path)
    if not files:
        raise RecordingError(
            f"{path}: no file of drives ({', '.join(SUFFIXES)}) and no ROS bag in this folder"
        )
    return files


def _inside(folder: Path) -> list[Path]:
    """The files of drives in a folder, which are not the heights of one another."""
    every = sorted(
        file
        for file in folder.iterdir()
        if file.name.endswith(SUFFIXES) or is_bag(file)
    )
    heights = {
        one.resolve()
        for file in every
        if ".csv" in file.name and (one := heights_file(file))
    }
    return [file for file in every if file.resolve() not in heights]


def _tables(path: Path, body: Body, topics: Sequence[str]) -> Iterable[Table]:
    if is_bag(path):
        from sidm.recordings.bags import read_bag  # whose library not everyone has

        return [read_bag(path, body, topics)]
    if path.suffix == ".npz":
        return read_npz(path, body)
    if path.name.endswith(SUFFIXES):
        return [read_csv(path, body)]
    raise RecordingError(f"{path}: drives are {', '.join(SUFFIXES)} or ROS bags")


def is_bag(path: Path) -> bool:
    """Whether a path is a ROS bag: a file of ROS 1, or a folder of ROS 2."""
    return path.suffix == ".bag" or (
        path.is_dir() and (path / "metadata.yaml").is_file()
    )


def drives_of(table: Table, body: Body) -> list[Drive]:
    """A table's drives at the body's rate; RecordingError where its numbers are not those of driving."""
    ground = table.ground and checks.whole_ground(table.name, table.ground)
    count = len(next(iter(table.columns.values())))
    session, drive = (
        table.labels.get(name, np.full(count, "")) for name in ("session", "drive")
    )
    changes = (
        np.flatnonzero((session[1:] != session[:-1]) | (drive[1:] != drive[:-1])) + 1
    )
    found = []
    for number, rows in enumerate(np.split(np.arange(count), changes)):
        label = (
            "/".join(filter(None, (session[rows[0]], drive[rows[0]])))
            if len(rows)
            else ""
        )
        label = label or str(number)
        where = f"{table.name}: drive {label}" if len(changes) else table.name
        part = {name: values[rows] for name, values in table.columns.items()}
        if table.ground and body.pose_size:
            part |= {
                name: part[name] - middle
                for name, middle in zip("xy", table.ground.centre, strict=True)
            }
        states, actions = _resampled(where, part, body, table.rate)
        if len(actions) < FEWEST_STEPS:
            raise RecordingError(
                f"{where}: {len(actions)} steps of {1 / body.rate:g} s; a drive has {FEWEST_STEPS}"
            )
        actions = checks.within_limits(where, actions, body)
        checks.refuse_other_maps(where, states, ground, body)
        if checks.has_twist(body):
            checks.refuse_other_velocities(where, states, body)
        belongs = str(session[rows[0]] or f"{table.name} {label}")
        name = (
            f"{table.name} drive {label}"
            if len(changes) or not table.labels
            else table.name
        )
        found.append(Drive(states, actions, body, ground, name, session=belongs))
    checks.refuse_jumps(found, body)
    return found


def _resampled(
    where: str, part: Mapping[str, np.ndarray], body: Body, rate: float | None
) -> tuple[np.ndarray, np.ndarray]:
    """States (K + 1, S) and actions (K, A) of one drive at the body's rate."""
    states = np.stack([part[name] for name, _ in body.state], 1)
    actions = np.stack([part[name] for name, _ in body.actions], 1)
    time = np.arange(len(states)) / rate if rate else part["time"] - part["time"][:1]
    checks.refuse_numbers(where, states, actions, body)
    spacing = checks.refuse_times(where, time)
    grid = np.arange(0, time[-1] + 1e-6 * spacing, 1 / body.rate)
    angles = [
        number for number, (_, unit) in enumerate(body.state) if unit in UNITS["angle"]
    ]
    states[:, angles] = np.unwrap(states[:, angles], axis=0)
    if body.pose == "spatial":
        states[:, 3:7] = checks.unit_quaternions(where, states[:, 3:7])
        # else nothing is interpolated, and signs stay
        if len(grid) != len(time) or not np.allclose(grid, time):
            states[:, 3:7] *= _signs(states[:, 3:7])
    if checks.has_twist(body):
        checks.refuse_other_turning(where, states, 1 / spacing)
    size = body.pose_size
    fresh = _fresh(states[:, :size]) if size else np.ones(len(time), bool)
    new = np.stack(
        [
            np.interp(
                grid, *((time[fresh], one[fresh]) if number < size else (time, one))
            )
            for number, one in enumerate(states.T)
        ],
        1,
    )
    if body.pose == "spatial":
        new[:, 3:7] /= np.linalg.norm(new[:, 3:7], axis=1, keepdims=True)
    # the row whose action holds at each time
    held = np.searchsorted(time, grid + 1e-6 * spacing, side="right") - 1
    means = [
        actions[a : max(b, a + 1)].mean(0)
        for a, b in zip(held[:-1], held[1:], strict=True)
    ]
    return new, np.reshape(means, (len(grid) - 1, actions.shape[1]))


def _signs(quaternions: np.ndarray) -> np.ndarray:
    """(R, 1): what makes each of quaternions (R, 4) the nearer of its two signs to the one before."""
    turned = (quaternions[1:] * quaternions[:-1]).sum(1) < 0
    return np.cumprod(np.r_[1.0, np.where(turned, -1.0, 1.0)])[:, None]


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


def write_drives(path: str | Path, drives: Sequence[Drive], origin: str) -> None:
    """Write drives as a file that `read_drives` reads: .csv, .csv.gz, or .npz, which holds their grounds as well.

    Args:
        path: of the file.
        drives: of one robot.
        origin: where they are from, for people.

    Raises:
        ValueError: another kind of file, none to write, or grounds that this kind does
            not hold.
        OSError: it cannot be written; one line.
    """
    path = Path(path)
    if not drives:
        raise ValueError(f"{path}: there are no drives to write")
    body = drives[0].body
    if not path.name.endswith(SUFFIXES) or (body.map_size and path.suffix != ".npz"):
        kinds = ".npz" if body.map_size else ", ".join(SUFFIXES)
        raise ValueError(f"{path}: drives of body '{body.name}' are written as {kinds}")
    (write_npz if path.suffix == ".npz" else write_csv)(path, drives, origin)
