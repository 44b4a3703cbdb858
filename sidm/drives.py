"""The motion of a robot in NumPy: the state, a drive, the ground under it; from the simulator and from files alike.

The state of a robot of the paper, 13 numbers (`sidm.body` says what other robots have):

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
from sidm.config import Fault
from sidm.systems import Terrain

POSITION, QUATERNION, TWIST = slice(0, 3), slice(3, 7), slice(7, 13)
STATE_SIZE, ACTION_SIZE = 13, 2
#: control steps of a simulated trajectory, and of a window that networks learn from
STEPS = 64
CONTROL_STEP = 0.1  # s

PROBES = 8
#: of a row's and a column's share of the ground to the next probe's: none are in line
SPREAD = (0.618034, 0.754878)
SAME_HEIGHT = 1e-6  # m; processors differ by some 1e-14


def upright(states: Any) -> Any:
    """The cosine (...) of the tilt of states (..., 13), arrays or tensors; below 0 they are upside down."""
    x, y = states[..., QUATERNION][..., 0], states[..., QUATERNION][..., 1]
    return 1 - 2 * (x * x + y * y)


def yaw_of(quaternions: np.ndarray) -> np.ndarray:
    """Headings (...), rad in (-pi, pi], of quaternions (..., 4); `sidm.rotations.yaw` is the same on tensors."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2))


def tilt_of(quaternions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pitch, nose down positive, and roll, right side down positive, rad, each (...), of quaternions (..., 4)."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    return np.arcsin(np.clip(2 * (w * y - z * x), -1, 1)), np.arctan2(
        2 * (w * x + y * z), 1 - 2 * (x**2 + y**2)
    )


class Ground(NamedTuple):
    """The ground that was driven on.

    >>> ground = sidm.Ground(np.zeros((81, 81)), spacing=0.1)  # 8 m by 8 m of flat floor
    >>> ground.centre
    (0.0, 0.0)

    Attributes:
        heights: (H, W), m, index [y, x]
        spacing: m, between neighbours of the grid
        centre: x and y of the grid's middle, m
    """

    heights: np.ndarray
    spacing: float
    centre: tuple[float, float] = (0.0, 0.0)


class GroundError(Fault):
    """A simulated ground that cannot be made again as it was; the message is one line."""


class SimulatedGround(NamedTuple):
    """Generated ground, kept as its seed: its heights are made again each time that they are asked for."""

    terrain: Terrain
    seed: int  # generate_terrain(terrain, seed) makes its heights
    #: of the heights' bits where the robot was simulated; a part of a dataset's digest
    checksum: str
    #: (8,) m, `probe` of the heights, by which any machine knows the ground again
    probe: np.ndarray

    @property
    def heights(self) -> np.ndarray:
        """(H, W), m, index [y, x]; GroundError where this machine makes other ones."""
        from sidm.terrain import generate_terrain  # which brings SciPy

        heights = generate_terrain(self.terrain, self.seed)
        if not np.allclose(probe(heights), self.probe, rtol=0, atol=SAME_HEIGHT):
            raise GroundError(
                f"terrain {self.seed} is no longer the one that was driven on; delete the collection's folder and "
                "collect again"
            )
        return heights

    @property
    def spacing(self) -> float:
        """Between neighbours of the grid, m."""
        return self.terrain.spacing

    @property
    def centre(self) -> tuple[float, float]:
        """X and y of the grid's middle, m."""
        return 0.0, 0.0


AnyGround = Ground | SimulatedGround


def probe(heights: np.ndarray) -> np.ndarray:
    """Heights (8,), m, at places spread over a ground (H, W)."""
    rows, columns = (
        (np.arange(1, PROBES + 1) * step % 1 * size).astype(int)
        for step, size in zip(SPREAD, heights.shape, strict=True)
    )
    return heights[rows, columns]


@dataclass(frozen=True, eq=False, repr=False)
class Drive:
    """K control steps of one robot, at its body's rate, in SI units.

    Attributes:
        states: (K + 1, S); the paper's S is 13
        actions: (K, A); the paper's A is 2
        body: what states and actions are made of, and how many a second
        ground: of a body with a height map; positions are relative to its middle
        name: for messages
        robot: which robot drove; of a simulated one its system and role
        session: drives of one session are all for training or all for validation
        index: number of the drive within a simulated collection
        discarded: simulated attempts thrown away before this one, a number for each
            cause

    Raises:
        ValueError: states or actions do not have the body's shape.

    Examples:
        >>> sidm.Drive(states=np.zeros((11, 13)), actions=np.zeros((10, 2)), name="at rest")
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
        """Refuse arrays that are not of the body."""
        states, actions, body = np.shape(self.states), np.shape(self.actions), self.body
        wanted = (
            (len(actions) and actions[0] + 1, len(body.state)),
            (states and states[0] - 1, len(body.actions)),
        )
        if (states, actions) != wanted or not actions[0]:
            raise ValueError(
                f"a drive of body '{body.name}' has states (K + 1, {len(body.state)}) and actions "
                f"(K, {len(body.actions)}) of at least one step, not {states} and {actions}"
            )

    def __len__(self) -> int:
        """K, control steps."""
        return len(self.actions)

    def __repr__(self) -> str:
        return f"Drive({self.name!r}: {len(self)} steps of {1 / self.body.rate:g} s, body {self.body.name!r})"


def minutes_of(drives: Iterable[Drive]) -> float:
    """Minutes of motion."""
    return sum(len(drive) / drive.body.rate for drive in drives) / 60
