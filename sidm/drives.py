"""Motion of a robot in NumPy: drives and the ground under them, simulated or recorded.

The state of the paper's robots has 13 numbers (`sidm.body` says what others have):

=====  ====================  ========  ==========================
index  quantity              unit      frame
=====  ====================  ========  ==========================
0-2    position              m         world
3-6    quaternion x,y,z,w    -         body to world
7-9    linear velocity       m/s       body
10-12  angular velocity      rad/s     body
=====  ====================  ========  ==========================

Body frame: x forward, y left, z up, origin at the chassis' centre of mass. An action is
(throttle, steering), each in [-1, 1]; a control step lasts 0.1 s.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from sidm.body import ROVER, Body
from sidm.config import DataError
from sidm.systems import CONTROL_STEP as CONTROL_STEP  # also known from here
from sidm.systems import Terrain

POSITION, QUATERNION, TWIST = slice(0, 3), slice(3, 7), slice(7, 13)
ACTION_SIZE = 2
#: Control steps of a simulated trajectory, and of a window that networks learn from.
STEPS = 64

PROBES = 8  # points at which the heights of a ground are kept
#: Distance between neighbouring probes along y and x, as shares of the ground's sides,
#: modulo 1; no two probes share a row or a column.
SPREAD = (0.618034, 0.754878)
SAME_HEIGHT = 1e-6  # m; the same ground differs by about 1e-14 between processors


def upright(states: Any) -> Any:
    """Cosine (...) of the tilt of states (..., 13), NumPy's or PyTorch's."""
    x, y = states[..., QUATERNION][..., 0], states[..., QUATERNION][..., 1]
    return 1 - 2 * (x * x + y * y)


def yaw_of(quaternions: np.ndarray) -> np.ndarray:
    """Headings (...), rad in (-pi, pi], of quaternions (..., 4), arrays."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2))


def tilt_of(quaternions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pitch (nose down) and roll (right side down), rad, of quaternions (..., 4)."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    return pitch, np.arctan2(2 * (w * x + y * z), 1 - 2 * (x**2 + y**2))


class Ground(NamedTuple):
    """Heights of the ground that a robot drives on.

    Attributes:
        heights: (H, W), m, index [y, x]
        spacing: distance between neighbours of the grid, m
        centre: x and y of the grid's middle, m

    Examples:
        >>> ground = sidm.Ground(np.zeros((81, 81)), spacing=0.1)  # 8 m by 8 m, flat
        >>> ground.centre
        (0.0, 0.0)
    """

    heights: np.ndarray
    spacing: float
    centre: tuple[float, float] = (0.0, 0.0)


class GroundError(DataError):
    """Generated ground differs from that of the simulation; the message is one line."""


class SimulatedGround(NamedTuple):
    """Generated ground, kept as its seed; its heights are generated at each access."""

    terrain: Terrain  # the kind of ground
    seed: int  # `generate_terrain(terrain, seed)` returns its heights
    #: of the heights' bits where the robot was simulated; in the digest of a dataset
    checksum: str
    #: (8,), m, heights by which another machine checks that it generates this ground
    probe: np.ndarray

    @property
    def heights(self) -> np.ndarray:
        """Heights (H, W), m, index [y, x]; GroundError if they are not as they were."""
        from sidm.terrain import generate_terrain  # which imports SciPy

        heights = generate_terrain(self.terrain, self.seed)
        if not np.allclose(probe(heights), self.probe, rtol=0, atol=SAME_HEIGHT):
            raise GroundError(
                f"terrain {self.seed} is no longer the one that was driven on; "
                "delete the collection's folder and collect again"
            )
        return heights

    @property
    def spacing(self) -> float:
        """Distance between neighbours of the grid, m."""
        return self.terrain.spacing

    @property
    def centre(self) -> tuple[float, float]:
        """Coordinates x and y of the grid's middle, m."""
        return 0.0, 0.0


AnyGround = Ground | SimulatedGround


def probe(heights: np.ndarray) -> np.ndarray:
    """Heights (8,), m, at points spread over a ground (H, W)."""
    rows, columns = (
        (np.arange(1, PROBES + 1) * step % 1 * size).astype(int)
        for step, size in zip(SPREAD, heights.shape, strict=True)
    )
    return heights[rows, columns]


@dataclass(frozen=True, eq=False, repr=False)
class Drive:
    """K control steps of one robot, at its body's rate, in SI units.

    Attributes:
        states: (K + 1, S); S is 13 for the paper's robots
        actions: (K, A); A is 2 for the paper's robots
        body: what states and actions consist of, and how many there are a second
        ground: for a body with a height map; positions are relative to its middle
        name: for messages
        robot: which robot drove; its system and role if it was simulated
        session: drives of one session are all for training or all for validation
        index: number of the drive within a simulated collection
        discarded: simulated attempts that were thrown away before this drive, a number
            for each cause

    Examples:
        >>> states, actions = np.zeros((11, 13)), np.zeros((10, 2))
        >>> sidm.Drive(states=states, actions=actions, name="at rest")
        Drive('at rest': 10 steps of 0.1 s, body 'rover')
    """

    states: np.ndarray
    actions: np.ndarray
    body: Body = ROVER
    ground: AnyGround | None = None
    name: str = ""
    robot: str = ""
    session: str = ""
    index: int = 0
    discarded: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        """Refuse arrays whose shapes do not match the body or each other."""
        for name in ("states", "actions"):
            object.__setattr__(self, name, np.asarray(getattr(self, name)))
        states, actions = self.states.shape, self.actions.shape
        steps = actions[0] if actions else 0
        body, width, commands = self.body, len(self.body.state), len(self.body.actions)
        if not steps or (states, actions) != ((steps + 1, width), (steps, commands)):
            raise ValueError(
                f"a drive of body '{body.name}' has states (K + 1, {width}) and "
                f"actions (K, {commands}) of at least one step, "
                f"not {states} and {actions}"
            )

    def __len__(self) -> int:
        """K, the number of control steps."""
        return len(self.actions)

    def __repr__(self) -> str:
        steps = f"{len(self)} steps of {1 / self.body.rate:g} s"
        return f"Drive({self.name!r}: {steps}, body {self.body.name!r})"


def minutes_of(drives: Iterable[Drive]) -> float:
    """Minutes of motion in all drives together."""
    return sum(len(drive) / drive.body.rate for drive in drives) / 60
