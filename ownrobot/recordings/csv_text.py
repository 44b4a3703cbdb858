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
import sys
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

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
#: A name and perhaps a unit in brackets.
TITLE = re.compile(r"\s*(.*?)\s*(?:\[(.*)\])?\s*")
SPARSE = 0.3  # share of empty cells from which a file has topics of several rates


@dataclass
class TextTable:
    """A CSV file, read but not yet understood."""

    header: dict[str, str]
    names: list[str]
    units: list[str]  # '' where a column has none
    cells: list[Sequence[str]]  # of each column
    lines: Sequence[int]  # number of the line of each row
    decimal_commas: bool
    notes: list[str] = field(default_factory=list)  # what was left out

    def column(self, name: str) -> Sequence[str]:
        """The cells of a column."""
        return self.cells[self.names.index(name)]

    def numbers(
        self, name: str, lenient: bool = False, largest: float = LARGEST
    ) -> np.ndarray:
        """The numbers (R,) of a column; others are refused, or NaN if `lenient`."""
        cells = self.column(name)
        if self.decimal_commas:
            comma = next((n for n, cell in enumerate(cells) if "," in cell), None)
            if comma is not None and any(
                "." in cell and math.isfinite(as_float(cell))
                for column in self.cells
                for cell in column
            ):
                raise RecordingError(
                    f"line {self.lines[comma]}: '{cells[comma]}' of "
                    f"'{name}' has a comma, and other numbers have points; remove "
                    "commas between thousands"
                )
            cells = [cell.replace(",", ".") for cell in cells]
        values = np.array([*map(as_float, cells)])
        bad = np.flatnonzero(~(np.abs(values) <= largest))
        if lenient:
            values[bad] = np.nan
        elif bad.size:
            self.refuse_sparse()
            first = bad[0]
            beyond = np.isfinite(values[first])
            if name == "time" and not beyond and len(bad) == len(values):
                raise RecordingError(
                    f"line {self.lines[first]}: '{cells[first]}' of 'time' is no "
                    "number; export times as numbers of s, ms, us or ns"
                )
            raise RecordingError(
                f"line {self.lines[first]}: '{cells[first]}' of '{name}' is "
                f"{'beyond 1e15' if beyond else 'no finite number'}; leave the line out"
            )
        return values

    def elapsed(self) -> np.ndarray:
        """The column `time` (R,) less its first; whole numbers are exact."""
        try:
            whole = [*map(int, self.column("time"))]
        except ValueError:
            values = self.numbers("time", largest=sys.float_info.max)
            return values - values[0]
        return np.array([value - whole[0] for value in whole], float)

    def refuse_sparse(self) -> None:
        """Refuse a file in which each row has the cells of one topic of several."""
        count = sum(not cell.strip() for column in self.cells for cell in column)
        share = count / max(1, sum(map(len, self.cells)))
        if share > SPARSE:
            raise RecordingError(
                f"{share:.0%} of its cells are empty, as where topics of "
                "several rates are exported together; export them at one rate, or fill "
                "each cell with the one above it"
            )


def text_of(path: Path) -> TextTable:
    """Read a file's header and cells; RecordingError names the first fault."""
    header, comments, kept = split_header(path)
    if not kept:
        what = "after its header" if header else "the file is empty"
        raise RecordingError(f"it has no rows of numbers: {what}")
    lines, texts = [number for number, _ in kept], [line for _, line in kept]
    other = next((s for s in SEPARATORS if s in texts[0] and "," not in texts[0]), ",")
    separator = header.pop("sep", other)
    try:
        rows = [*csv.reader(texts, delimiter=separator)]
    except csv.Error as error:
        raise RecordingError(
            f"no table of numbers ({error}); is a quotation mark left open?"
        ) from None
    if len(lines) != len(rows):  # cells with line breaks
        lines = list(range(lines[0], lines[0] + len(rows)))
    if not _are_numbers(rows[0]):
        titles, rows, lines = rows[0], rows[1:], lines[1:]
    else:  # names behind `#`
        titles = next(csv.reader(comments[-1:], delimiter=separator), [])
        if len(titles) != len(rows[0]) or _are_numbers(titles):
            raise RecordingError(
                f"line {lines[0]} has numbers; write the names and units of "
                "the columns there, as 'x [m]'"
            )
    if len(rows) < 2:
        only = "no rows" if not rows else "a single row"
        raise RecordingError(f"it has {only} of numbers; a drive has many")
    matches = [match for cell in titles if (match := TITLE.fullmatch(cell))]
    names, units = [m[1] for m in matches], [(m[2] or "").strip() for m in matches]
    if all(row[-1:] == [""] for row in rows) and (
        not names[-1] or len(rows[0]) == len(names) + 1
    ):
        rows = [row[:-1] for row in rows]
        names, units = names[: len(rows[0])], units[: len(rows[0])]
    notes = []
    if len(rows[-1]) < len(names) and len(rows) > 2:
        notes.append("the last line is cut off, and is left out")
        rows.pop()
    for line, row in zip(lines, rows, strict=False):
        if len(row) != len(names):
            raise RecordingError(
                f"line {line} has {len(row)} cells, not {len(names)}; "
                f"{_separator_hint(row, len(names))}"
            )
    cells: list[Sequence[str]] = [*zip(*rows, strict=True)]
    return TextTable(header, names, units, cells, lines, separator != ",", notes)


def _are_numbers(cells: Sequence[str]) -> bool:
    return all(math.isfinite(as_float(cell.replace(",", "."))) for cell in cells)


def split_header(
    path: Path,
) -> tuple[dict[str, str], list[str], list[tuple[int, str]]]:
    """The header of a file, its comments, and the numbered lines after it."""
    lines = _decoded(path).splitlines()
    header: dict[str, str] = {}
    comments: list[str] = []
    kept: list[tuple[int, str]] = []
    if lines and (found := re.fullmatch(r"sep=(.)", lines[0].strip())):
        header["sep"] = found[1]
        lines[0] = ""
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        if not line.startswith("#") or (kept and _as_many_cells(line, kept[0][1])):
            kept.append((number, line))
            continue
        text = line.lstrip("#").strip()
        name, colon, value = map(str.strip, text.partition(":"))
        value = value.rstrip(",;\t ")  # a spreadsheet fills up its rows
        if kept:
            continue
        if not colon or name not in HEADER:
            if colon and difflib.get_close_matches(name, HEADER, cutoff=0.8):
                raise RecordingError(unknown_name(name, HEADER, "the header"))
            comments.append(text)
        elif name in header:
            raise RecordingError(f"the header has two lines '# {name}: ...'")
        else:
            header[name] = value
    return header, comments, kept


def _as_many_cells(line: str, other: str) -> bool:
    """Whether two lines have the same separators, and some."""
    counts = [
        (one.count(","), one.count(";"), one.count("\t")) for one in (line, other)
    ]
    return counts[0] == counts[1] and any(counts[0])


def _decoded(path: Path) -> str:
    """The text of a file, which may be compressed; UTF-8, or UTF-16 with its mark."""
    unpack = {".gz": gzip.decompress, ".xz": lzma.decompress}
    try:
        content = unpack.get(path.suffix.lower(), bytes)(path.read_bytes())
        wide = content[:2] in (b"\xff\xfe", b"\xfe\xff")
        return content.decode("utf-16" if wide else "utf-8-sig")
    except (OSError, EOFError, zlib.error, lzma.LZMAError, ValueError) as error:
        raise RecordingError(f"cannot be read as text ({error})") from None


def _separator_hint(cells: Sequence[str], count: int) -> str:
    """The end of a message about a line that has not `count` cells."""
    for sign, name in SEPARATORS.items():
        if any(sign in cell for cell in cells):
            return (
                f"it seems to be separated by {name}: use commas, and points in numbers"
            )
    if len(cells) == 2 * count:
        return "has it decimal commas? Use points, or semicolons between cells"
    return "write a cell for each name"


def as_float(text: str) -> float:
    """The number in a text; NaN where the text is no number."""
    try:
        return float(text)
    except ValueError:
        return math.nan
