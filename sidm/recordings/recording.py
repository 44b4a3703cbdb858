"""A recording in memory: its columns and their units."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sidm.trajectory import POSITION, QUATERNION, STEPS, TWIST

RATE = 10.0  # Hz, of the control steps
STATE = ("x", "y", "z", "qx", "qy", "qz", "qw", "vx", "vy", "vz", "wx", "wy", "wz")
ACTION = ("throttle", "steering")

#: Column -> kind of quantity; all but the time have to be there.
COLUMNS = (
    dict.fromkeys(STATE[POSITION], "length") | dict.fromkeys(STATE[QUATERNION], "number")
    | dict.fromkeys(STATE[TWIST][:3], "velocity") | dict.fromkeys(STATE[TWIST][3:], "angular velocity")
    | dict.fromkeys(ACTION, "number") | {"time": "time"}
)  # fmt: skip


class RecordingError(ValueError):
    """What is wrong with a recording: one line that names file, place and fault."""


class Ground(NamedTuple):
    """The ground that was driven on."""

    heights: np.ndarray  # (H, W), m, index [y, x]
    spacing: float  # m, between neighbours of the grid
    centre: tuple[float, float] = (0.0, 0.0)  # x and y of the grid's middle, m


class Recording(NamedTuple):
    """K control steps of a robot from elsewhere; positions are relative to the middle of its ground."""

    name: str  # for messages
    states: np.ndarray  # (K + 1, 13) float64, as the table of `sidm.trajectory`
    actions: np.ndarray  # (K, 2) float64
    ground: Ground  # its centre at the origin

    @property
    def pieces(self) -> int:
        """How many trajectories of STEPS steps it holds; what is left over at its end is not used."""
        return len(self.actions) // STEPS
