"""What is read of a file before it becomes drives: a table of numbers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sidm.config import Fault
from sidm.drives import Ground


class RecordingError(Fault):
    """What is wrong with recorded motion: one line that names file, place and fault."""


class Table(NamedTuple):
    """Rows of numbers by the names of their columns, in SI units."""

    name: str  # of the file, for messages
    columns: dict[str, np.ndarray]  # (R,) each
    labels: dict[str, np.ndarray]  # (R,) of text: drive and session, where they are
    rate: float | None  # Hz, where there is no time
    ground: Ground | None = None
