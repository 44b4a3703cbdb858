"""What is read of a file, and what it becomes: tables of numbers, drives at the body's rate, the ground under them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sidm.config import Fault


class RecordingError(Fault):
    """What is wrong with recorded motion: one line that names file, place and fault."""


class Ground(NamedTuple):
    """The ground that was driven on."""

    heights: np.ndarray  # (H, W), m, index [y, x]
    spacing: float  # m, between neighbours of the grid
    centre: tuple[float, float] = (0.0, 0.0)  # x and y of the grid's middle, m


class Table(NamedTuple):
    """Rows of numbers by the names of their columns, in SI units."""

    name: str  # of the file, for messages
    columns: dict[str, np.ndarray]  # (R,) each
    labels: dict[str, np.ndarray]  # (R,) of text: drive and session, where they are
    rate: float | None  # Hz, where there is no time
    ground: Ground | None = None


class Drive(NamedTuple):
    """K control steps of a robot, at its body's rate, in SI units."""

    name: str  # for messages
    session: str  # drives of one session belong together
    states: np.ndarray  # (K + 1, S) float64
    actions: np.ndarray  # (K, A) float64
    ground: Ground | None = None  # of a body with a height map; positions are relative to its middle
