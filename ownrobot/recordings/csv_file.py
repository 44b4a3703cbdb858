"""Read and write drives as CSV files, which may be compressed.

A file begins with header lines `# name: value`, whose names are those of HEADER. The
next line has the names of the columns, with units in brackets:

    # rate: 20 Hz
    drive,x [m],y [m],yaw [deg],yaw_rate [rad/s],left [rad/s],right [rad/s]

The columns are those of the body's state and actions, in any order and in any unit of
their kind. Three more columns have a meaning: `time` replaces the rate; `drive` changes
where a new drive begins; drives of the same `session` are never divided between
training and evaluation. All other columns are ignored. Semicolons or tabs may stand in
place of the commas; numbers may then have decimal commas.

For a body with a height map, the header names a file of heights beside the CSV file
(`heights`) and its grid's `spacing`.
"""

from __future__ import annotations

import csv
import gzip
import io
import math
import re
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ownrobot.recordings.checks import LARGEST
from ownrobot.recordings.table import RecordingError, Table, unit_factors
from sidm.body import SI, Body
from sidm.config import first_line, unknown_name
from sidm.drives import Drive, Ground
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
SEPARATORS = {";": "semicolons", "\t": "tabs"}  # that may stand in place of commas
#: A name and perhaps a unit in brackets; a file of numbers alone has none.
TITLE = re.compile(r"\s*(.*?)\s*(?:\[(.*)\])?\s*")


class TextTable(NamedTuple):
    """A CSV file, read but not yet understood."""

    path: Path
    header: dict[str, str]
    names: list[str]
    units: list[str]  # '' where a column has none
    cells: list[Sequence[str]]  # of each column
    first: int  # number of the line with the first cells
    decimal_commas: bool

    def numbers(self, name: str, lenient: bool = False) -> np.ndarray:
        """The numbers (R,) of a column; RecordingError names the first that is none.

        If `lenient`, a cell that is no number is NaN.
        """
        cells = self.cells[self.names.index(name)]
        if self.decimal_commas:
            cells = [cell.replace(",", ".") for cell in cells]
        values = np.array([_float(cell) for cell in cells])
        bad = np.flatnonzero(~(np.abs(values) <= LARGEST)).tolist()
        if lenient:
            values[bad] = np.nan
        elif bad:
            line, cell = self.first + bad[0], cells[bad[0]]
            beyond = np.isfinite(values[bad[0]])
            fault = "beyond 1e15" if beyond else "no finite number"
            raise RecordingError(
                f"{self.path}: line {line}: '{cell}' of '{name}' is {fault}; "
                "leave the line out"
            )
        return values


def read_csv(path: Path, body: Body, lenient: bool = False) -> Table:
    """Read the columns of a body from a file; RecordingError names the first fault.

    Args:
        path: of the file.
        body: whose columns are read.
        lenient: whether a cell that is no number is read as NaN in a file of several
            drives; its drive alone is then refused.
    """
    text = read_text(path)
    header, names = text.header, text.names
    timed = "time" in names
    if not timed and "rate" not in header:
        raise RecordingError(
            f"{path}: it has neither a line '# rate: 10 Hz' nor a column 'time [s]'"
        )
    factors = unit_factors(str(path), names, text.units, body, timed)
    lenient = lenient and bool({"drive", "session"} & set(names))
    columns = {
        name: text.numbers(name, lenient) * factor for name, factor in factors.items()
    }
    labels: dict[str, np.ndarray] = {
        name: np.array(text.cells[names.index(name)])
        for name in ("drive", "session")
        if name in names
    }
    rate = None if timed else rate_of(text)
    ground = _ground(path, header) if body.map_size else None
    return Table(str(path), columns, labels, rate, ground)


def rate_of(text: TextTable) -> float:
    """The rate in a file's header, Hz."""
    return _number(text.path, text.header, "rate", "Hz")


def read_text(path: Path) -> TextTable:
    """Read a file's header and cells; RecordingError names the first fault.

    The cells are separated by commas, or by semicolons or tabs; with these, numbers may
    have decimal commas.
    """
    header, lines, first = _split_header(path)
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        what = "after its header" if header else "the file is empty"
        raise RecordingError(f"{path}: it has no rows of numbers: {what}")
    given = (sign for sign in SEPARATORS if sign in lines[0] and "," not in lines[0])
    separator = next(given, ",")
    try:
        rows = list(csv.reader(lines, delimiter=separator))
    except csv.Error as error:
        raise RecordingError(
            f"{path}: no table of numbers ({error}); is a quotation mark left open?"
        ) from None
    titles = [TITLE.fullmatch(cell) for cell in rows[0]]
    names = [match[1] for match in titles if match]
    if all(math.isfinite(_float(name.replace(",", "."))) for name in names):
        raise RecordingError(
            f"{path}: line {first} has numbers; write the names and units of the "
            "columns there, as 'x [m]'"
        )
    if len(rows) < 3:
        only = "no rows" if len(rows) < 2 else "a single row"
        raise RecordingError(f"{path}: it has {only} of numbers; a drive has many")
    units = [(match[2] or "").strip() for match in titles if match]
    cells = _cells(path, rows[1:], first + 1, names)
    return TextTable(path, header, names, units, cells, first + 1, separator != ",")


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
    except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
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
                f"not {len(names)}{_separator_hint(row, len(names))}"
            )
    return list(zip(*rows, strict=True))


def _separator_hint(cells: Sequence[str], count: int) -> str:
    """The end of a message where a line seems to have other separators than commas."""
    line = ",".join(cells)
    for sign, name in SEPARATORS.items():
        if sign in line:
            return (
                f"; it seems to be separated by {name}: "
                "use commas, and points in numbers"
            )
    if len(cells) == 2 * count:
        return "; has it decimal commas? Use points, or semicolons between cells"
    return "; write a cell for each name"


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
