"""Read and write drives as CSV files, which may be compressed.

A file begins with header lines `# name: value`, whose names are those of HEADER. The
next line has the names of the columns, with units in brackets:

    # rate: 20 Hz
    drive,x [m],y [m],yaw [deg],yaw_rate [rad/s],left [rad/s],right [rad/s]

The columns are those of the body's state and actions, in any order and in any unit of
their kind. Three more columns have a meaning: `time` replaces the rate; `drive` changes
where a new drive begins; drives of the same `session` are never divided between
training and evaluation. All other columns are ignored. Semicolons or tabs may stand in
place of the commas; numbers may then have decimal commas. A line `# rate` is not used
where there is a column `time`; a time may be in s, ms, us or ns, or be two columns of
seconds and nanoseconds.

Programs that export the topics of a robot, as PlotJuggler does, name columns by topic:
parts of messages as `/odom/pose/pose/position/x` are read as the same part of a bag is.

For a body with a height map, the header names a file of heights beside the CSV file
(`heights`) and its grid's `spacing`.
"""

from __future__ import annotations

import gzip
import lzma
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ownrobot.recordings.csv_text import (
    HEADER,
    TextTable,
    as_float,
    split_header,
    text_of,
)
from ownrobot.recordings.messages import (
    QUATERNION,
    columns_of_part,
    plain_name,
    unit_of,
)
from ownrobot.recordings.table import RecordingError, Table, unit_factors
from sidm.body import SI, Body
from sidm.config import first_line
from sidm.drives import Drive, Ground, yaw_of
from sidm.storage import write_atomically

SECONDS = re.compile(r"(.*?)(secs?|seconds)", re.IGNORECASE)
NANOSECONDS = re.compile(r"(.*?)(nsecs?|nanosecs?|nanoseconds)", re.IGNORECASE)
#: Names of a time -> its unit where the file gives none; '': the file must give it.
CLOCKS = {"__time": "s", "%time": "ns", "timestamp": "", "stamp": ""}
#: The path of a number of a joint, or of a message that is one number -> its column.
NAMED = re.compile(r"(?:.*/)?(?:joint_states/)?(?P<name>[^/]+)/(velocity|data)")


def read_csv(path: Path, body: Body, lenient: bool = False) -> Table:
    """Read a body's columns; if `lenient`, what is no number can be NaN."""
    text = read_text(path)
    header, names = text.header, text.names
    timed = "time" in names
    if not timed and "rate" not in header:
        raise RecordingError(
            "it has neither a line '# rate: 10 Hz' nor a column 'time [s]'"
        )
    factors = unit_factors(names, text.units, body, timed)
    labels: dict[str, np.ndarray] = {
        name: np.array([cell.strip() for cell in text.column(name)])
        for name in ("drive", "session")
        if name in names
    }
    lenient = lenient and bool(labels)
    columns = {
        name: (text.elapsed() if name == "time" else text.numbers(name, lenient))
        * factor
        for name, factor in factors.items()
    }
    rate = None if timed else rate_of(text)
    ground = _ground(path.parent, header) if body.map_size else None
    return Table(str(path), columns, labels, rate, ground, text.notes)


def rate_of(text: TextTable) -> float:
    """The rate in a file's header, Hz."""
    return _number(text.header, "rate", "Hz")


def heights_file(path: Path) -> Path | None:
    """The file of heights that a file of drives names in its header, if any."""
    try:
        return path.parent / split_header(path)[0]["heights"]
    except (RecordingError, KeyError):
        return None


def _number(header: Mapping[str, str], name: str, unit: str) -> float:
    number = as_float(header[name].removesuffix(unit))
    if not 0 < number < float("inf"):
        raise RecordingError(
            f"'{name}: {header[name]}' is not a positive number in {unit}"
        )
    return number


def _ground(folder: Path, header: Mapping[str, str]) -> Ground:
    """The ground that a header describes, with heights (H, W), m, of another file."""
    for name in ("heights", "spacing"):
        if name not in header:
            raise RecordingError(
                f"the header has no line '# {name}: ...' ({HEADER[name]})"
            )
    try:
        x, y = map(float, header.get("centre", "0 0").removesuffix("m").split())
    except ValueError:
        raise RecordingError(
            f"'centre: {header['centre']}' is not an x and a y in m"
        ) from None
    file = folder / header["heights"]
    try:
        if file.suffix == ".npy":
            heights = np.load(file, allow_pickle=False)
        else:
            heights = np.loadtxt(file, delimiter=",", ndmin=2, encoding="utf-8-sig")
    except FileNotFoundError:
        raise RecordingError("there is no such file of heights", file) from None
    except (OSError, ValueError, EOFError) as error:
        fault = f"the heights cannot be read ({first_line(error)})"
        raise RecordingError(fault, file) from None
    return Ground(heights, _number(header, "spacing", "m"), (x, y))


def read_text(path: Path) -> TextTable:
    """Read a CSV file's header and cells, with the names that other files have."""
    table = text_of(path)
    if "time" not in table.names:
        _name_time(table)
    _name_parts(table)
    _add_yaw(table)
    return table


def _name_time(table: TextTable) -> None:
    """Call a table's stamps `time`, where they have another name or two columns."""
    names, units, cells = table.names, table.units, table.cells
    for name, unit in CLOCKS.items():
        if names.count(name) == 1:
            number = names.index(name)
            if units[number] or unit:
                names[number], units[number] = "time", units[number] or unit
                return
    seconds = {found[1]: n for n in names if (found := SECONDS.fullmatch(n))}
    for name in names:
        found = NANOSECONDS.fullmatch(name)
        if not found or found[1] not in seconds:
            continue
        first, second = names.index(seconds[found[1]]), names.index(name)
        try:
            whole = ([int(as_float(c)) for c in cells[n]] for n in (first, second))
            stamps = [str(s * 10**9 + ns) for s, ns in zip(*whole, strict=True)]
        except ValueError:
            return
        names[first], units[first], cells[first] = "time", "ns", stamps
        del names[second], units[second], cells[second]
        return


def _name_parts(table: TextTable) -> None:
    """Name columns as in a bag, where no two paths in messages mean the same."""
    names, units = table.names, table.units
    meant = {name: _column_of(name) for name in names}
    inertial = {meant[name] for name in names if "angular_velocity" in name}
    for name in names:
        if "twist" in name and meant[name] in inertial:
            meant[name] = ""
    columns = list(meant.values())
    for number, name in enumerate([*names]):
        column = meant[name]
        if column and columns.count(column) == 1 and column not in names:
            names[number] = column
            if not name.endswith("data"):  # the message of a number has no unit
                units[number] = units[number] or unit_of(column)


def _column_of(path: str) -> str:
    """The name of the column that a path in a message means; '' for other names."""
    parts = path.strip("/").replace(".", "/")
    part, slash, axis = parts.rpartition("/")
    if not slash:
        return ""
    if column := columns_of_part(part).get(axis):
        return column
    found = NAMED.fullmatch(parts)
    return plain_name(found["name"]) if found else ""


def _add_yaw(table: TextTable) -> None:
    """Add the yaw of a table's quaternions, where it has no other yaw."""
    names = table.names
    if "yaw" in names or any(names.count(name) != 1 for name in QUATERNION):
        return
    comma, point = (",", ".") if table.decimal_commas else (".", ".")
    parts = [
        [as_float(cell.replace(comma, point)) for cell in table.column(name)]
        for name in QUATERNION
    ]
    yaws = yaw_of(np.transpose(parts))
    table.cells.append([str(yaw).replace(point, comma) for yaw in yaws])
    table.names.append("yaw")
    table.units.append("rad")


def write_csv(path: Path, drives: Sequence[Drive], origin: str) -> None:
    """Write drives in SI units, compressed as the end of the file's name says."""
    import pandas as pd

    body, lengths = drives[0].body, [len(drive.states) for drive in drives]
    titles = [f"{name} [{SI[unit]}]" for name, unit in (*body.state, *body.actions)]
    actions = np.vstack([np.vstack([d.actions, d.actions[-1:]]) for d in drives])
    rows = np.hstack([np.vstack([drive.states for drive in drives]), actions])
    frame = pd.DataFrame(rows, columns=titles)
    frame.insert(0, "session", np.repeat([drive.session for drive in drives], lengths))
    frame.insert(1, "drive", np.repeat(np.arange(len(drives)), lengths))
    table = frame.to_csv(index=False, float_format="%.12g", lineterminator="\n")
    rate = str(body.rate).removesuffix(".0")  # all digits of a rate such as 20 / 3 Hz
    text = f"# origin: {origin}\n# rate: {rate} Hz\n{table}".encode()
    if path.suffix == ".gz":
        text = gzip.compress(text, mtime=0)
    elif path.suffix == ".xz":
        text = lzma.compress(text)
    write_atomically(path, lambda file: file.write(text))
