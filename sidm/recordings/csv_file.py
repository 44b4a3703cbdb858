"""A recording as a CSV file, with the heights of its ground in a file beside it.

The file begins with lines `# name: value`, of HEADER, and then has the names of its columns, units in brackets:

    # rate: 50 Hz
    # heights: meadow.csv
    # spacing: 0.1 m
    x [m],y [m],z [m],qx,qy,qz,qw,vx [m/s],...,throttle,steering
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from sidm.config import unknown_name
from sidm.recordings.recording import Ground, Recording, RecordingError
from sidm.recordings.table import from_table

#: Names of the header: what each is.
HEADER = {
    "rate": "rows a second, Hz",
    "heights": "file of the ground's heights in m beside this, .csv without names or .npy: a line along x for each y, "
    "the smallest first",
    "spacing": "of the ground's grid, m",
    "centre": "x and y of the ground's middle, m; 0 0 unless given",
    "origin": "where the recording is from, for people",
}

SEPARATORS = {";": "semicolons", "\t": "tabs"}  # that are none here


def has_header(path: Path) -> bool:
    """Whether a file begins like a recording; what cannot be read does not."""
    try:
        with open(path, encoding="utf-8-sig") as file:
            return file.readline().startswith("#")
    except (OSError, UnicodeDecodeError):
        return False


def read_header(path: Path) -> dict[str, str]:
    """The values of a file's header; RecordingError names its first fault."""
    lines = _lines(path)
    return _header(path, lines[: _first_row(lines)])


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: cannot be read as text ({error})") from None


def _first_row(lines: Sequence[str]) -> int:
    """Number of the line after the header."""
    return next((number for number, line in enumerate(lines) if not line.startswith("#")), len(lines))


def read_csv(path: Path) -> Recording:
    """The recording of a file; RecordingError names its first fault."""
    lines = _lines(path)
    start, header = _first_row(lines), read_header(path)
    if start == len(lines):
        raise RecordingError(f"{path}: no line with the names of the columns")
    named = [re.fullmatch(r"\s*(.*?)\s*(?:\[(.*)\])?\s*", cell) for cell in next(csv.reader([lines[start]]))]
    columns = [match[1] for match in named if match]
    units = [(match[2] or "1").strip() for match in named if match]
    rows = _numbers(path, lines[start + 1 :], start + 2, len(columns))
    rate, spacing = _number(path, header, "rate", "Hz"), _number(path, header, "spacing", "m")
    ground = Ground(_heights(path.parent / header["heights"]), spacing, _centre(path, header))
    return from_table(str(path), columns, units, rate, rows, ground)


def _header(path: Path, lines: Sequence[str]) -> dict[str, str]:
    header = {}
    for line in lines:
        name, colon, value = line.lstrip("#").partition(":")
        name = name.strip()
        if not colon:
            raise RecordingError(f"{path}: '{line}' in the header is not '# name: value'")
        if name not in HEADER:
            raise RecordingError(f"{path}: {unknown_name(name, HEADER, 'the header')}")
        if name in header:
            raise RecordingError(f"{path}: the header has two lines '# {name}: ...'")
        header[name] = value.strip()
    for name in ("rate", "heights", "spacing"):
        if name not in header:
            raise RecordingError(f"{path}: the header has no line '# {name}: ...' ({HEADER[name]})")
    return header


def _number(path: Path, header: Mapping[str, str], name: str, unit: str) -> float:
    try:
        return float(header[name].removesuffix(unit))
    except ValueError:
        raise RecordingError(f"{path}: '{name}: {header[name]}' is not a number in {unit}") from None


def _centre(path: Path, header: Mapping[str, str]) -> tuple[float, float]:
    try:
        x, y = (float(one) for one in header.get("centre", "0 0").removesuffix("m").split())
    except ValueError:
        raise RecordingError(f"{path}: 'centre: {header['centre']}' is not an x and a y in m") from None
    return x, y


def _numbers(path: Path, lines: Sequence[str], first: int, count: int | None = None) -> np.ndarray:
    """The rows of lines, of which the first has the number `first` in its file; empty ones are passed over."""
    rows: list[list[float]] = []
    for number, cells in enumerate(csv.reader(lines), start=first):
        if cells:
            count = count or len(cells)
            if len(cells) != count:
                raise RecordingError(f"{path}: line {number} has {len(cells)} numbers, not {count}{_separated(cells)}")
            try:
                rows.append([float(cell) for cell in cells])
            except ValueError as error:
                raise RecordingError(f"{path}: line {number}: {error}{_separated(cells)}") from None
    if not rows:
        raise RecordingError(f"{path}: it has no rows of numbers")
    return np.array(rows)


def _separated(cells: Sequence[str]) -> str:
    """What to do about a line that another sign than a comma separates; nothing for any other."""
    line = ",".join(cells).strip()
    other = [words for sign, words in SEPARATORS.items() if sign in line]
    return f"; it seems to be separated by {other[0]}: use commas, and points in numbers" if other else ""


def _heights(path: Path) -> np.ndarray:
    """Heights (H, W), m, of a .csv or .npy file."""
    try:
        if path.suffix == ".npy":
            return np.load(path, allow_pickle=False)
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except FileNotFoundError:
        raise RecordingError(f"{path}: there is no such file of heights") from None
    except (OSError, ValueError, EOFError) as error:
        raise RecordingError(f"{path}: the heights cannot be read ({error})") from None
    return _numbers(path, lines, 1)
