"""The table of numbers that is read from a file and then made into drives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sidm.config import DataError
from sidm.drives import Ground


class RecordingError(DataError):
    """A fault of recorded motion: one line that names file, place and fault."""


class Table(NamedTuple):
    """Rows of numbers by the names of their columns, in SI units."""

    name: str  # file name, for messages
    columns: dict[str, np.ndarray]  # (R,) each
    labels: dict[str, np.ndarray]  # (R,) each, text: drive and session, where given
    rate: float | None  # Hz, where there is no column of time
    ground: Ground | None = None
