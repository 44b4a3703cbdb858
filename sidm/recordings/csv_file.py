"""Drives as a CSV file, which may be compressed, with the heights of their ground in a file beside it.

The file begins with lines `# name: value`, of HEADER, and then has the names of its
columns, units in brackets:

    # rate: 20 Hz
    drive,x [m],y [m],yaw [deg],yaw_rate [rad/s],left [rad/s],right [rad/s]

Columns are those of the body's state and actions, in any order and any unit of their
kind; those that no body names are left out. Three more may be there: `time`, in place
of a rate, `drive`, which changes where another drive begins, and `session`, whose
drives belong together and are never parted between learning and judging. A body with a
height map asks for `heights` and `spacing` in the header.
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

#: Names of the header: what each is.
HEADER = {
    "rate": "rows a second, Hz",
    "heights": "file of the ground's heights in m beside this, .csv without names or .npy: a line along x for each y, "
    "the smallest first",
    "spacing": "of the ground's grid, m",
    "centre": "x and y of the ground's middle, m; 0 0 unless given",
    "origin": "where the drives are from, for people",
}
EXTRA = ("time", "drive", "session")
SEPARATORS = {";": "semicolons", "\t": "tabs"}  # that are none here


def read_csv(path: Path, body: Body) -> Table:
    """The rows of a file that a body names; RecordingError names the first fault."""
    header, lines, first = _parts(path)
    try:
        rows = list(csv.reader(lines))
    except csv.Error as error:
        raise RecordingError(
            f"{path}: no table of numbers ({error}); is a quotation mark left open?"
        ) from None
    if len(rows) < 3:
        raise RecordingError(f"{path}: it has no rows of numbers")
    named = [re.fullmatch(r"\s*(.*?)\s*(?:\[(.*)\])?\s*", cell) for cell in rows[0]]
    names, units = (
        [match[1] for match in named if match],
        [(match[2] or "").strip() for match in named if match],
    )
    cells = _cells(path, rows[1:], first + 1, names)
    timed = "time" in names
    if not timed and "rate" not in header:
        raise RecordingError(
            f"{path}: it has neither a line '# rate: 10 Hz' nor a column 'time [s]'"
        )
    factors = scales(str(path), names, units, body, timed)
    columns = {
        name: _numbers(path, name, cells[names.index(name)], first + 1) * factors[name]
        for name in factors
    }
    labels = {
        name: np.array(cells[names.index(name)])
        for name in ("drive", "session")
        if name in names
    }
    rate = None if timed else _number(path, header, "rate", "Hz")
    return Table(
        str(path),
        columns,
        labels,
        rate,
        _ground(path, header) if body.map_size else None,
    )


def scales(
    name: str, names: Sequence[str], units: Sequence[str], body: Body, timed: bool
) -> dict[str, float]:
    """Columns that a body names, and the time if it is wanted -> times which numbers in these units are in the SI's.

    Raises:
        RecordingError: one is missing, there twice, or in another unit; `name` is the
            file's.
    """
    wanted = dict((*body.state, *body.actions)) | ({"time": "s"} if timed else {})
    for column in wanted:
        if column not in names:
            what = f"column '{column}' of body '{body.name}'"
            raise RecordingError(f"{name}: {what} is missing; {hint(column, names)}")
    for column in (*wanted, *EXTRA):
        if names.count(column) > 1:
            raise RecordingError(f"{name}: two columns '{column}'")
    return {
        column: _scale(name, column, units[names.index(column)], unit)
        for column, unit in wanted.items()
    }


def _scale(file: str, name: str, unit: str, wanted: str) -> float:
    """Times which numbers of a column in `unit` are in the SI unit of the kind that `wanted` is of."""
    kind = next(kind for kind, units in UNITS.items() if wanted in units)
    unit = unit or ("1" if kind == "number" else "")
    if unit not in UNITS[kind]:
        shown, article = (
            f"in '{unit}'" if unit else "without a unit",
            "an" if kind[0] in "aeiou" else "a",
        )
        raise RecordingError(
            f"{file}: '{name}' {shown}; {article} {kind} is in {' or '.join(UNITS[kind])}"
        )
    return UNITS[kind][unit]


def heights_file(path: Path) -> Path | None:
    """The file of heights that the header of a file of drives names; None where it names none, or is no header."""
    try:
        return path.parent / _parts(path)[0]["heights"]
    except (RecordingError, KeyError):
        return None


def _parts(path: Path) -> tuple[dict[str, str], list[str], int]:
    """The header, the lines behind it, and the number of the first of those."""
    try:
        with (gzip.open if path.suffix == ".gz" else open)(
            path, "rt", encoding="utf-8-sig"
        ) as file:
            lines = file.read().splitlines()
    except (OSError, EOFError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: cannot be read as text ({error})") from None
    count = next(
        (number for number, line in enumerate(lines) if not line.startswith("#")),
        len(lines),
    )
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
    """Columns of text; `first` is the number of the first row's line."""
    for number, row in enumerate(rows, start=first):
        if len(row) != len(names):
            raise RecordingError(
                f"{path}: line {number} has {len(row)} cells, not {len(names)}{_separated(row)}"
            )
    return list(zip(*rows, strict=True))


def _separated(cells: Sequence[str]) -> str:
    """What to do about a line that another sign than a comma separates; nothing for any other."""
    line = ",".join(cells)
    other = [words for sign, words in SEPARATORS.items() if sign in line]
    return (
        f"; it seems to be separated by {other[0]}: use commas, and points in numbers"
        if other
        else ""
    )


def _numbers(path: Path, name: str, cells: Sequence[str], first: int) -> np.ndarray:
    """A column; `first` is the number of its first line."""
    values = np.array([_float(cell) for cell in cells])
    for bad in np.flatnonzero(~np.isfinite(values)).tolist():
        raise RecordingError(
            f"{path}: line {first + bad}: '{cells[bad]}' of '{name}' is no finite number"
        )
    return values


def _float(text: str) -> float:
    """The number that a text stands for; not a number where it stands for none."""
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
        x, y = (
            float(one) for one in header.get("centre", "0 0").removesuffix("m").split()
        )
    except ValueError:
        raise RecordingError(
            f"{path}: 'centre: {header['centre']}' is not an x and a y in m"
        ) from None
    return Ground(
        _heights(path.parent / header["heights"]),
        _number(path, header, "spacing", "m"),
        (x, y),
    )


def _heights(path: Path) -> np.ndarray:
    """Heights (H, W), m, of a .csv or .npy file."""
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
    """Write drives of a body without a height map, in SI units, compressed where the name ends in .gz."""
    body = drives[0].body
    file = io.StringIO()
    file.write(f"# origin: {origin}\n# rate: {body.rate:g} Hz\n")
    lines = csv.writer(file, lineterminator="\n")
    lines.writerow(
        [
            "session",
            "drive",
            *(f"{name} [{SI[unit]}]" for name, unit in (*body.state, *body.actions)),
        ]
    )
    for number, drive in enumerate(drives):
        actions = np.vstack([drive.actions, drive.actions[-1:]])
        for row in np.hstack([drive.states, actions]):
            lines.writerow([drive.session, number, *(f"{value:.9g}" for value in row)])
    text = file.getvalue().encode()
    packed = gzip.compress(text, mtime=0) if path.suffix == ".gz" else text
    write_atomically(path, lambda file: file.write(packed))
