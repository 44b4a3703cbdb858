"""Read drives of a robot of any body, bring them to the body's rate, and check them.

A pause in a recording makes several drives of it, of one session. What is left out of a
recording, and what is done with it, is told by a `RecordingWarning`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np

from ownrobot.body_file import as_body
from ownrobot.recordings import checks, frames
from ownrobot.recordings.csv_file import heights_file, read_csv, write_csv
from ownrobot.recordings.headings import drives_along_yaw
from ownrobot.recordings.npz_file import read_npz, write_npz
from ownrobot.recordings.resampling import drives_of_rows, pose_rate, rows_of_drives
from ownrobot.recordings.table import Findings, RecordingError, Table
from sidm.body import SI, Body
from sidm.config import hint, no_such_file, replace
from sidm.drives import Drive

if TYPE_CHECKING:
    import pandas as pd

SUFFIXES = (".csv", ".csv.gz", ".csv.xz", ".npz")
INNER = (".db3", ".mcap")  # files inside the folder of a ROS 2 bag
ALIKE = (".csv", ".tsv", ".gz", ".xz", ".npz", ".bag")  # of files that may be drives


def read_drives(
    path: str | Path | Sequence[str | Path] | pd.DataFrame,
    body: Body | str | Path | Mapping[str, Any],
    topics: Sequence[str] = (),
    allow_constant: bool = False,
    skip_bad: bool = False,
) -> list[Drive]:
    """Read the drives of a file or a ROS bag, of all files of a folder, or of a table.

    Args:
        path: of the file, the bag or the folder, or a sequence of such paths; in
            'NAME=PATH', NAME is the session of all drives there. Or a table in memory
            with columns as in a CSV file, in SI units: a row for each time, with the
            columns `time`, s, and those of the body; `drive` or `session` too where
            there are several drives.
        body: the robot's body, its YAML file, or the mapping in such a file.
        topics: names of the topics to read from bags; all unless given.
        allow_constant: whether to accept a column that never changes. A model can be
            tried with such drives, but cannot learn from them.
        skip_bad: whether faulty drives and files are left out. Each is told by a
            `RecordingWarning`, as are pauses and what else may surprise.

    Returns:
        The drives, at the body's rate and in SI units.

    Raises:
        RecordingError: there are no drives, or the first fault, in one line; with
            `skip_bad`, a fault of all drives together.

    Examples:
        >>> body = "recordings/skid_steer.yaml"
        >>> drives = ownrobot.read_drives("recordings/warthog.csv.gz", body)
        >>> len(drives), drives[0].states.shape
        (287, (20, 6))
    """
    body, findings = as_body(body), Findings(skip_bad, not skip_bad)
    if is_table(path):
        where = "the table"
        table = _table_of(where, path, body, findings)
        drives = _drives_of_file(where, [table], body, findings)
    else:
        paths = as_paths(path)
        if not paths:
            raise RecordingError("the list of paths is empty; name a file or a folder")
        where = ", ".join(map(str, paths))
        drives = drives_of_paths(paths, body, topics, findings)
    findings.warn()
    if not drives:
        raise RecordingError(findings.faults[0])
    for fault in frames.faults_together(where, drives, body, allow_constant):
        raise RecordingError(fault)
    return drives


def drives_of_paths(
    paths: Sequence[Path], body: Body, topics: Sequence[str], findings: Findings
) -> list[Drive]:
    """Drives of files, bags and folders; `findings` takes faults and notes."""
    _note_units(body, findings)
    files: list[tuple[str, Path]] = []  # with their sessions
    for given in paths:
        session, path = session_and_path(given)
        with findings.kept(path):
            found = files_of(path)
            files += [(session, file) for file in found]
            if left := _not_read(path, found):
                findings.notes.append(
                    f"{path}: {len(left)} files are not read, as {left[0]}; drives are "
                    f"files {', '.join(SUFFIXES)} in the folder itself, or named one "
                    "by one"
                )
    if files and topics and not any(is_bag(file) for _, file in files):
        where = ", ".join(map(str, paths))
        raise RecordingError(
            "topics are of ROS bags, and this is none; leave --topics out", where
        )
    drives = []
    for session, file in files:
        with findings.kept(file):
            tables = _tables(file, body, topics, findings.skip)
            read = _drives_of_file(str(file), tables, body, findings)
            drives += [replace(d, session=session) for d in read] if session else read
    return drives


def _drives_of_file(
    name: str, tables: Sequence[Table], body: Body, findings: Findings
) -> list[Drive]:
    """Drives of all tables of a file; `findings` takes faults and notes."""
    findings.notes += [f"{name}: {note}" for table in tables for note in table.notes]
    drives = [drive for table in tables for drive in _drives(table, body, findings)]
    with findings.kept(name):
        return drives_along_yaw(name, drives, body, findings)
    return []


def is_table(source: Any) -> TypeGuard[pd.DataFrame]:
    """Whether a source of drives is a table in memory."""
    return hasattr(source, "columns") and hasattr(source, "to_numpy")


def _table_of(name: str, frame: pd.DataFrame, body: Body, findings: Findings) -> Table:
    """The columns of a body from a table in memory."""
    _note_units(body, findings)
    required = ["time", *(name for name, _ in (*body.state, *body.actions))]
    if missing := [name for name in required if name not in frame]:
        raise RecordingError(
            f"{name} has no column '{missing[0]}'; "
            f"body '{body.name}' wants {', '.join(required)}"
        )
    columns = {name: frame[name].to_numpy(float) for name in required}
    given = [name for name in ("drive", "session") if name in frame]
    labels = {name: frame[name].to_numpy(str) for name in given}
    return Table(name, columns, labels, None)


def _note_units(body: Body, findings: Findings) -> None:
    """Add a note about each column of a body whose unit is unknown."""
    findings.notes += [
        f"body '{body.name}': '{name}' is in '{unit}', an unknown unit, in which its "
        f"numbers stay; {hint(unit, SI)}"
        for name, unit in body.unknown_units.items()
    ]


def as_paths(path: str | Path | Sequence[str | Path]) -> list[Path]:
    """A list of one path or of several."""
    return list(map(Path, [path] if isinstance(path, (str, Path)) else path))


def session_and_path(given: str | Path) -> tuple[str, Path]:
    """The session and the path in 'NAME=PATH'; '' and the path where none is named."""
    name, sign, path = str(given).partition("=")
    named = sign and name and not Path(given).exists()
    return (name, Path(path)) if named else ("", Path(given))


def has_bags(path: str | Path | Sequence[str | Path]) -> bool:
    """Whether a ROS bag is among the files that `read_drives` would read."""
    read = [session_and_path(one)[1] for one in as_paths(path)]
    existing = [one for one in read if one.exists()]
    inside = (part for one in existing if one.is_dir() for part in one.iterdir())
    return any(map(is_bag, [*existing, *inside]))


def files_of(path: Path) -> list[Path]:
    """The file or bag itself, or the files of drives in a folder, without heights."""
    if not path.exists():
        raise RecordingError(no_such_file(path).removeprefix(f"{path}: "))
    if not path.is_dir() or is_bag(path):
        if path.suffix in INNER and not is_bag(path):
            raise RecordingError(
                f"it is a file inside a ROS 2 bag; give the bag's folder, {path.parent}"
            )
        return [path]
    inside = sorted(path.iterdir())
    files = [f for f in inside if f.name.lower().endswith(SUFFIXES) or is_bag(f)]
    if not files:
        inner = next((file.name for file in inside if file.suffix in INNER), "")
        raise RecordingError(
            f"no file of drives ({', '.join(SUFFIXES)}) and no ROS bag in this folder; "
            + (
                f"{inner} has no metadata.yaml, which 'ros2 bag reindex' makes"
                if inner
                else "give the folder that has them"
            )
        )
    heights = {file.resolve() for file in _heights_of(files)}
    return [file for file in files if file.resolve() not in heights]


def _heights_of(files: Sequence[Path]) -> set[Path]:
    """The files of heights that CSV files name."""
    named = [heights_file(file) for file in files if ".csv" in file.name.lower()]
    return {file for file in named if file}


def _not_read(folder: Path, files: Sequence[Path]) -> list[Path]:
    """Files below a folder that look like drives and are not among those read."""
    if not folder.is_dir() or is_bag(folder):
        return []
    read = {*files, *_heights_of(files)}
    return sorted(
        file
        for file in folder.rglob("*")
        if file.suffix.lower() in ALIKE
        and file.is_file()
        and not read & {file, *file.parents}  # a file of a bag is read with it
    )


def _tables(
    path: Path, body: Body, topics: Sequence[str], lenient: bool
) -> Sequence[Table]:
    """The tables of a file or a bag."""
    if is_bag(path):
        from ownrobot.recordings.bags import read_bag  # its library is optional

        return [read_bag(path, body, topics)]
    if path.suffix.lower() == ".npz":
        return read_npz(path, body)
    if path.name.lower().endswith(SUFFIXES):
        return [read_csv(path, body, lenient)]
    raise RecordingError(f"drives are {', '.join(SUFFIXES)} or ROS bags")


def is_bag(path: Path) -> bool:
    """Whether a path is a ROS bag: a file of ROS 1, a folder of ROS 2, a lone .mcap."""
    about = "metadata.yaml"
    lone = path.suffix == ".mcap" and not (path.parent / about).is_file()
    folder = path.is_dir() and (path / about).is_file()
    return path.suffix == ".bag" or folder or (lone and path.is_file())


def _drives(table: Table, body: Body, findings: Findings) -> list[Drive]:
    """Drives from a table, at the body's rate; `findings` takes faults and notes."""
    drives: list[Drive] = []
    with findings.kept(table.name):
        ground = table.ground and checks.whole_ground(table.ground)
        rows = rows_of_drives(table, body, findings)
        if rows:
            row_rate = 1 / float(np.median([one.spacing for one in rows]))
            poses = [(one.time, one.states[:, : body.pose_size]) for one in rows]
            checks.refuse_slower(row_rate, pose_rate(poses), body)
            findings.rates += [1 / one.spacing for one in rows]
        for one in rows:
            with findings.kept(one.where):
                drives += drives_of_rows(one, body, ground, findings)
        faults = checks.jumps(drives, body)
        for fault in faults.values():
            findings.add(fault)
        if checks.has_twist(body):
            turned = [(one.states, 1 / one.spacing) for one in rows]
            frames.refuse_other_turning(turned)
        return [drive for number, drive in enumerate(drives) if number not in faults]
    return []


def write_drives(path: str | Path, drives: Sequence[Drive], origin: str) -> None:
    """Write drives of one robot to a file that `read_drives` reads.

    It is .csv, .csv.gz, .csv.xz or, which alone holds grounds, .npz; others raise
    ValueError, and OSError's message is one line. `origin` says where the drives come
    from, for people.
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
