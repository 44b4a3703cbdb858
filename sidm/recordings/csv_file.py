"""Read and write drives as CSV files, which may be compressed.

A file begins with header lines `# name: value`, whose names are those of HEADER. The
next line has the names of the columns, with units in brackets:

    # rate: 20 Hz
    drive,x [m],y [m],yaw [deg],yaw_rate [rad/s],left [rad/s],right [rad/s]

The columns are those of the body's state and actions, in any order and in any unit of
their kind. Three more columns have a meaning: `time` replaces the rate; `drive` changes
where a new drive begins; drives of the same `session` are never divided between
training and evaluation. All other columns are ignored.

For a body with a height map, the header names a file of heights beside the CSV file
(`heights`) and its grid's `spacing`.
"""

from __future__ import annotations

import csv
import gzip
import io
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from sidm.body import SI, UNITS, Body
from sidm.config import first_line, hint, unknown_name
from sidm.drives import Drive, Ground
from sidm.recordings.table import RecordingError, Table
from sidm.storage import write_atomically

#: Name of a header's line -> what it says.
HEADER = {
    "rate": "rows a second, Hz",
    "heights": "file of the ground's heights in m beside this, .csv without names or "
    ".npy: a line along x for each y, the smallest first",
    "spacing": "of the ground's grid, m",
    "centre": "x and y of the ground's middle, m; 0 0 unless given",
    "origin": "where the drives are from, for people",
}
EXTRA = ("time", "drive", "session")
SEPARATORS = {";": "semicolons", "\t": "tabs"}  # of other files; here only commas


def read_csv(path: Path, body: Body) -> Table:
    """Read the columns of a body from a file; RecordingError names the first fault."""
    header, lines, first = _split_header(path)
    try:
        rows = list(csv.reader(lines))
    except csv.Error as error:
        raise RecordingError(
            f"{path}: no table of numbers ({error}); is a quotation mark left open?"
        ) from None
    if len(rows) < 3:
        raise RecordingError(f"{path}: it has no rows of numbers")
    titles = [re.fullmatch(r"\s*(.*?)\s*(?:\[(.*)\])?\s*", cell) for cell in rows[0]]
    names = [match[1] for match in titles if match]
    units = [(match[2] or "").strip() for match in titles if match]
    cells = _cells(path, rows[1:], first + 1, names)
    timed = "time" in names
    if not timed and "rate" not in header:
        raise RecordingError(
            f"{path}: it has neither a line '# rate: 10 Hz' nor a column 'time [s]'"
        )
    factors = unit_factors(str(path), names, units, body, timed)
    columns = {
        name: _numbers(path, name, cells[names.index(name)], first + 1) * factor
        for name, factor in factors.items()
    }
    labels = {
        name: np.array(cells[names.index(name)])
        for name in ("drive", "session")
        if name in names
    }
    rate = None if timed else _number(path, header, "rate", "Hz")
    ground = _ground(path, header) if body.map_size else None
    return Table(str(path), columns, labels, rate, ground)


def unit_factors(
    file: str, names: Sequence[str], units: Sequence[str], body: Body, timed: bool
) -> dict[str, float]:
    """Factors that bring the columns of a body into SI units.

    Args:
        file: name of the file, for messages.
        names: of the file's columns.
        units: of the file's columns, as many.
        body: whose columns are read.
        timed: whether the column `time` is read too.

    Returns:
        Name of each column that is read -> factor.

    Raises:
        RecordingError: a column is missing, occurs twice, or has a wrong unit.
    """
    wanted = dict((*body.state, *body.actions)) | ({"time": "s"} if timed else {})
    for column in wanted:
        if column not in names:
            raise RecordingError(
                f"{file}: column '{column}' of body '{body.name}' is missing; "
                f"{hint(column, names)}"
            )
    for column in (*wanted, *EXTRA):
        if names.count(column) > 1:
            raise RecordingError(f"{file}: two columns '{column}'")
    return {
        column: _unit_factor(file, column, units[names.index(column)], unit)
        for column, unit in wanted.items()
    }


def _unit_factor(file: str, name: str, unit: str, expected: str) -> float:
    """Factor from `unit` to the SI unit; the column is of the kind of `expected`."""
    kind = next(kind for kind, units in UNITS.items() if expected in units)
    unit = unit or ("1" if kind == "number" else "")
    if unit not in UNITS[kind]:
        given = f"in '{unit}'" if unit else "without a unit"
        article, known = "an" if kind[0] in "aeiou" else "a", " or ".join(UNITS[kind])
        raise RecordingError(
            f"{file}: '{name}' {given}; {article} {kind} is in {known}"
        )
    return UNITS[kind][unit]


def heights_file(path: Path) -> Path | None:
    """The file of heights that a file of drives names in its header.

    None where the file names none or has no valid header.
    """
    try:
        return path.parent / _split_header(path)[0]["heights"]
    except (RecordingError, KeyError):
        return None


def _split_header(path: Path) -> tuple[dict[str, str], list[str], int]:
    """The header of a file, the lines after it, and the number of the first of them."""
    opener = gzip.open if path.suffix == ".gz" else open
    try:
        with opener(path, "rt", encoding="utf-8-sig") as file:
            lines = file.read().splitlines()
    except (OSError, EOFError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: cannot be read as text ({error})") from None
    others = (n for n, line in enumerate(lines) if not line.startswith("#"))
    count = next(others, len(lines))
    return _header(path, lines[:count]), lines[count:], count + 1


def _header(path: Path, lines: Sequence[str]) -> dict[str, str]:
    header: dict[str, str] = {}
    for line in lines:
        name, colon, value = line.lstrip("#").partition(":")
        name = name.strip()
        if not colon:
            raise RecordingError(
                f"{path}: '{line}' in the header is not '# name: value'"
            )
        if name not in HEADER:
            raise RecordingError(f"{path}: {unknown_name(name, HEADER, 'the header')}")
        if name in header:
            raise RecordingError(f"{path}: the header has two lines '# {name}: ...'")
        header[name] = value.strip()
    return header


def _number(path: Path, header: Mapping[str, str], name: str, unit: str) -> float:
    number = _float(header[name].removesuffix(unit))
    if not 0 < number < float("inf"):
        raise RecordingError(
            f"{path}: '{name}: {header[name]}' is not a positive number in {unit}"
        )
    return number


def _cells(
    path: Path, rows: Sequence[Sequence[str]], first: int, names: Sequence[str]
) -> list[Sequence[str]]:
    """The columns of a table of text; `first` is the line number of its first row."""
    for number, row in enumerate(rows, start=first):
        if len(row) != len(names):
            raise RecordingError(
                f"{path}: line {number} has {len(row)} cells, "
                f"not {len(names)}{_separator_hint(row)}"
            )
    return list(zip(*rows, strict=True))


def _separator_hint(cells: Sequence[str]) -> str:
    """The end of a message where a line seems to have another separator than commas."""
    line = ",".join(cells)
    for sign, name in SEPARATORS.items():
        if sign in line:
            return (
                f"; it seems to be separated by {name}: "
                "use commas, and points in numbers"
            )
    return ""


def _numbers(path: Path, name: str, cells: Sequence[str], first: int) -> np.ndarray:
    """The numbers of a column; `first` is the line number of its first cell."""
    values = np.array([_float(cell) for cell in cells])
    bad = np.flatnonzero(~np.isfinite(values)).tolist()
    if bad:
        line, cell = first + bad[0], cells[bad[0]]
        raise RecordingError(
            f"{path}: line {line}: '{cell}' of '{name}' is no finite number"
        )
    return values


def _float(text: str) -> float:
    """The number in a text; NaN where the text is no number."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def _ground(path: Path, header: Mapping[str, str]) -> Ground:
    for name in ("heights", "spacing"):
        if name not in header:
            raise RecordingError(
                f"{path}: the header has no line '# {name}: ...' ({HEADER[name]})"
            )
    try:
        x, y = map(float, header.get("centre", "0 0").removesuffix("m").split())
    except ValueError:
        raise RecordingError(
            f"{path}: 'centre: {header['centre']}' is not an x and a y in m"
        ) from None
    heights = _heights(path.parent / header["heights"])
    return Ground(heights, _number(path, header, "spacing", "m"), (x, y))


def _heights(path: Path) -> np.ndarray:
    """Read heights (H, W), m, from a .csv or .npy file."""
    try:
        if path.suffix == ".npy":
            return np.load(path, allow_pickle=False)
        return np.loadtxt(path, delimiter=",", ndmin=2, encoding="utf-8-sig")
    except FileNotFoundError:
        raise RecordingError(f"{path}: there is no such file of heights") from None
    except (OSError, ValueError, EOFError) as error:
        raise RecordingError(
            f"{path}: the heights cannot be read ({first_line(error)})"
        ) from None


def write_csv(path: Path, drives: Sequence[Drive], origin: str) -> None:
    """Write drives in SI units, compressed where the file's name ends in .gz.

    Args:
        path: of the file.
        drives: of a body without a height map.
        origin: where the drives come from, for people.
    """
    body = drives[0].body
    file = io.StringIO()
    file.write(f"# origin: {origin}\n# rate: {body.rate:g} Hz\n")
    lines = csv.writer(file, lineterminator="\n")
    titles = [f"{name} [{SI[unit]}]" for name, unit in (*body.state, *body.actions)]
    lines.writerow(["session", "drive", *titles])
    for number, drive in enumerate(drives):
        actions = np.vstack([drive.actions, drive.actions[-1:]])
        for row in np.hstack([drive.states, actions]):
            lines.writerow([drive.session, number, *(f"{value:.9g}" for value in row)])
    text = file.getvalue().encode()
    packed = gzip.compress(text, mtime=0) if path.suffix == ".gz" else text
    write_atomically(path, lambda file: file.write(packed))
