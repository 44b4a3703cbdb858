"""The table of numbers that is read from a file, and what is found in files."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from sidm.body import Body, kind_of, units_like
from sidm.config import DataError, Notice, hint
from sidm.drives import Ground

#: Columns beside those of a body that have a meaning.
EXTRA = ("time", "drive", "session")


class RecordingError(DataError):
    """A fault of recorded motion: one line that names file, place and fault.

    Where a file is taken apart it has no place yet; `faults_of` names it.
    """

    def __init__(self, fault: object, place: object = ""):
        super().__init__(f"{place}: {fault}" if place else str(fault))
        self.place = str(place)


@contextlib.contextmanager
def faults_of(place: object) -> Iterator[None]:
    """Name the place, as a file, of a RecordingError in the block that has none."""
    try:
        yield
    except RecordingError as error:
        raise (error if error.place else RecordingError(error, place)) from None


class RecordingWarning(Notice):
    """What a reader does with recorded motion beyond reading it: one line.

    The commands print it on stderr as a line `note: ...`.
    """


class Table(NamedTuple):
    """Rows of numbers by the names of their columns, in SI units."""

    name: str  # file name, for messages
    columns: dict[str, np.ndarray]  # (R,) each
    labels: dict[str, np.ndarray]  # (R,) each, text: drive and session, where given
    rate: float | None  # Hz, where there is no column of time
    ground: Ground | None = None
    notes: Sequence[str] = ()  # what was done with the file, without its name
    session: str = ""  # of all rows, where no label says it; '': each drive has its own


class Findings:
    """What reading finds beside drives.

    Attributes:
        skip: whether a fault is kept in a list, and its drive or file left out;
            otherwise the first fault is raised
        doubtful: whether drives that are read with a note alone are kept
        faults: one line each
        notes: what was done with recordings that have no fault, one line each
        rates: rows a second of each drive, Hz
    """

    def __init__(self, skip: bool, doubtful: bool):
        self.skip, self.doubtful = skip, doubtful
        self.faults: list[str] = []
        self.notes: list[str] = []
        self.rates: list[float] = []

    def add(self, fault: RecordingError) -> None:
        """Keep a fault in the list, or raise it."""
        if not self.skip:
            raise fault
        self.faults.append(str(fault))

    @contextlib.contextmanager
    def kept(self, place: object) -> Iterator[None]:
        """Keep a RecordingError of the block, about this place, or raise it."""
        try:
            with faults_of(place):
                yield
        except RecordingError as error:
            self.add(error)

    def warn(self) -> None:
        """Issue each note, and each drive or file that is left out, as a warning."""
        left_out = [f"left out: {fault}" for fault in self.faults]
        for text in [*left_out, *self.notes]:
            # the caller of the function that reads is three levels up
            warnings.warn(RecordingWarning(text), stacklevel=3)


def unit_factors(
    names: Sequence[str], units: Sequence[str], body: Body, timed: bool
) -> dict[str, float]:
    """Factors that bring the columns of a body, and `time` if timed, into SI units.

    A column that is missing, occurs twice or has a wrong unit is refused.
    """
    wanted = dict((*body.state, *body.actions)) | ({"time": "s"} if timed else {})
    for column in wanted:
        if column not in names:
            raise RecordingError(
                f"column '{column}' of body '{body.name}' is missing; "
                f"{hint(column, names)}"
            )
    for column in (*wanted, *EXTRA):
        if names.count(column) > 1:
            raise RecordingError(f"two columns '{column}'; rename one of them")
    factors = {}
    for column, expected in wanted.items():
        kind, known = kind_of(expected), units_like(expected)
        unit = units[names.index(column)] or ("1" if kind == "number" else "")
        if unit not in known:
            given = f"in '{unit}'" if unit else "without a unit"
            article = "an" if kind[:1] in "aeiou" else "a"
            right = f"{article} {kind} is" if kind else "the body has it"
            raise RecordingError(f"'{column}' {given}; {right} in {' or '.join(known)}")
        factors[column] = known[unit]
    return factors
