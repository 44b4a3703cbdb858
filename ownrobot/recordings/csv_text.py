"""CSV files as text: header, names, units and cells, as loggers write them.

Names may stand behind `#` in the last line before the numbers. A spreadsheet's line
`sep=;`, comments, empty lines, separators at the end of each row, and a last row that a
power failure cut are no faults.
"""

from __future__ import annotations

import csv
import difflib
import gzip
import lzma
import math
import re
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ownrobot.recordings.checks import LARGEST
from ownrobot.recordings.table import RecordingError
from sidm.config import unknown_name

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
SPARSE = 0.3  # share of empty cells from which a file has topics of several rates


class TextTable(NamedTuple):
    """A CSV file, read but not yet understood."""

    path: Path
    header: dict[str, str]
    names: list[str]
    units: list[str]  # '' where a column has none
    cells: list[Sequence[str]]  # of each column
    lines: Sequence[int]  # number of the line of each row
    decimal_commas: bool
    notes: tuple[str, ...] = ()  # what was left out

    def numbers(self, name: str, lenient: bool = False) -> np.ndarray:
        """The numbers (R,) of a column; RecordingError names the first that is none.

        If `lenient`, a cell that is no number is NaN.
        """
        cells = self.cells[self.names.index(name)]
        if self.decimal_commas:
            self._refuse_thousands(name, cells)
            cells = [cell.replace(",", ".") for cell in cells]
        values = as_floats(cells)
        bad = np.flatnonzero(~(np.abs(values) <= LARGEST)).tolist()
        if lenient:
            values[bad] = np.nan
        elif bad:
            line, cell = self.lines[bad[0]], cells[bad[0]]
            self.refuse_sparse()
            beyond = np.isfinite(values[bad[0]])
            fault = "beyond 1e15" if beyond else "no finite number"
            raise RecordingError(
                f"{self.path}: line {line}: '{cell}' of '{name}' is {fault}; "
                "leave the line out"
            )
        return values

    def elapsed(self, name: str) -> np.ndarray:
        """A column of times (R,) less the first; whole numbers are exact."""
        cells = self.cells[self.names.index(name)]
        try:
            whole = [int(cell) for cell in cells]
        except ValueError:
            values = self.numbers(name)
            return values - values[0]
        return np.array([value - whole[0] for value in whole], float)

    def refuse_sparse(self) -> None:
        """Refuse a file in which each row has the cells of one topic of several."""
        count = sum(not cell.strip() for column in self.cells for cell in column)
        share = count / max(1, sum(map(len, self.cells)))
        if share > SPARSE:
            raise RecordingError(
                f"{self.path}: {share:.0%} of its cells are empty, as where topics of "
                "several rates are exported together; export them at one rate, or fill "
                "each cell with the one above it"
            )

    def _refuse_thousands(self, name: str, cells: Sequence[str]) -> None:
        """Refuse commas in numbers of a file whose numbers have points, too."""
        comma = next((n for n, cell in enumerate(cells) if "," in cell), None)
        if comma is not None and any("." in cell for c in self.cells for cell in c):
            raise RecordingError(
                f"{self.path}: line {self.lines[comma]}: '{cells[comma]}' of '{name}' "
                "has a comma, and other numbers have points; remove commas between "
                "thousands"
            )


def text_of(path: Path) -> TextTable:
    """Read a file's header and cells; RecordingError names the first fault.

    The cells are separated by commas, or by semicolons or tabs; with these, numbers may
    have decimal commas.
    """
    header, comments, lines = split_header(path)
    if not lines:
        what = "after its header" if header else "the file is empty"
        raise RecordingError(f"{path}: it has no rows of numbers: {what}")
    separator = header.pop("sep", "") or _separator(lines[0][1])
    try:
        rows = [*csv.reader([line for _, line in lines], delimiter=separator)]
    except csv.Error as error:
        raise RecordingError(
            f"{path}: no table of numbers ({error}); is a quotation mark left open?"
        ) from None
    numbers = [number for number, _ in lines]
    if len(numbers) != len(rows):  # cells with line breaks
        numbers = list(range(numbers[0], numbers[0] + len(rows)))
    titles, rows, numbers = _titles(path, rows, numbers, comments, separator)
    if len(rows) < 2:
        only = "no rows" if not rows else "a single row"
        raise RecordingError(f"{path}: it has {only} of numbers; a drive has many")
    matches = [TITLE.fullmatch(cell) for cell in titles]
    names = [match[1] for match in matches if match]
    units = [(match[2] or "").strip() for match in matches if match]
    if all(row[-1:] == [""] for row in rows) and (
        not names[-1] or len(rows[0]) == len(names) + 1
    ):
        rows = [row[:-1] for row in rows]
        names, units = names[: len(rows[0])], units[: len(rows[0])]
    notes = []
    if len(rows[-1]) < len(names) and len(rows) > 2:
        notes.append(f"{path}: the last line is cut off, and is left out")
        rows, numbers = rows[:-1], numbers[:-1]
    cells = _cells(path, rows, numbers, names)
    commas = separator != ","
    return TextTable(path, header, names, units, cells, numbers, commas, tuple(notes))


def _titles(
    path: Path,
    rows: list[list[str]],
    numbers: list[int],
    comments: Sequence[str],
    separator: str,
) -> tuple[list[str], list[list[str]], list[int]]:
    """The names of columns, the rows below them, and the numbers of their lines."""
    if not _are_numbers(rows[0]):
        return rows[0], rows[1:], numbers[1:]
    if comments:  # names behind `#`
        titles = next(csv.reader([comments[-1]], delimiter=separator))
        if len(titles) == len(rows[0]) and not _are_numbers(titles):
            return titles, rows, numbers
    raise RecordingError(
        f"{path}: line {numbers[0]} has numbers; write the names and units of the "
        "columns there, as 'x [m]'"
    )


def _are_numbers(cells: Sequence[str]) -> bool:
    return all(math.isfinite(as_float(cell.replace(",", "."))) for cell in cells)


def split_header(
    path: Path,
) -> tuple[dict[str, str], list[str], list[tuple[int, str]]]:
    """The header of a file, its comments, and the numbered lines after it.

    Comments between the lines and empty lines are left out. A spreadsheet's `sep=;` is
    the header's 'sep'.
    """
    lines = _decoded(path).splitlines()
    header: dict[str, str] = {}
    comments: list[str] = []
    if lines and (found := re.fullmatch(r"sep=(.)", lines[0].strip())):
        header["sep"] = found[1]
        lines[0] = ""
    kept = []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        if not line.startswith("#"):
            kept.append((number, line))
        elif not kept:
            _add_header(path, line, header, comments)
    return header, comments, kept


def _add_header(
    path: Path, line: str, header: dict[str, str], comments: list[str]
) -> None:
    """Add a line `# name: value` to a header; any other line is a comment."""
    text = line.lstrip("#").strip()
    name, colon, value = text.partition(":")
    name = name.strip()
    if not colon or name not in HEADER:
        if colon and difflib.get_close_matches(name, HEADER, cutoff=0.8):
            raise RecordingError(f"{path}: {unknown_name(name, HEADER, 'the header')}")
        comments.append(text)
    elif name in header:
        raise RecordingError(f"{path}: the header has two lines '# {name}: ...'")
    else:
        header[name] = value.strip()


def _decoded(path: Path) -> str:
    """The text of a file, which may be compressed; UTF-8, or UTF-16 with its mark."""
    try:
        content = path.read_bytes()
        if path.suffix.lower() == ".gz":
            content = gzip.decompress(content)
        elif path.suffix.lower() == ".xz":
            content = lzma.decompress(content)
        wide = content[:2] in (b"\xff\xfe", b"\xfe\xff")
        return content.decode("utf-16" if wide else "utf-8-sig")
    except (OSError, EOFError, zlib.error, lzma.LZMAError, ValueError) as error:
        raise RecordingError(f"{path}: cannot be read as text ({error})") from None


def _separator(line: str) -> str:
    """What separates the cells of a line."""
    return next((sign for sign in SEPARATORS if sign in line and "," not in line), ",")


def _cells(
    path: Path,
    rows: Sequence[Sequence[str]],
    numbers: Sequence[int],
    names: Sequence[str],
) -> list[Sequence[str]]:
    """The columns of a table of text; `numbers` are those of the rows' lines."""
    for number, row in zip(numbers, rows, strict=True):
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


def as_floats(texts: Sequence[str]) -> np.ndarray:
    """The numbers (R,) in texts; NaN where a text is no number."""
    try:
        return np.array([*map(float, texts)])
    except ValueError:
        return np.array([*map(as_float, texts)])


def as_float(text: str) -> float:
    """The number in a text; NaN where the text is no number."""
    try:
        return float(text)
    except ValueError:
        return math.nan
