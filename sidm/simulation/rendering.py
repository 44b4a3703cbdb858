"""The links and struts in pictures, where the simulation has no bodies for them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from sidm.simulation.dimensions import AXLES
from sidm.simulation.linkage import rods
from sidm.simulation.suspension import Suspension

LINK = (0.006, (0.35, 0.36, 0.38, 1.0))  # radius, m, and colour
STRUT_TUBE = (0.013, (0.0, 0.45, 0.70, 1.0))
STRUT_ROD = (0.006, (0.85, 0.85, 0.87, 1.0))
#: m, lengths of a strut's two parts; a whole strut is 0.16 m long at zero travel
TUBE_LENGTH, ROD_LENGTH = 0.095, 0.110


class Cylinder(NamedTuple):
    """A part of a link or strut where it now is."""

    look: tuple[float, tuple[float, ...]]  # radius, m, and colour
    length: float  # m
    middle: np.ndarray  # (3,), m, in the world
    direction: np.ndarray  # (3,), a unit vector in the world


class DrawnRods:
    """The links and struts as shapes without mass, moved before each picture."""

    def __init__(
        self,
        client: Any,
        body: int,
        axles: Mapping[str, int],
        suspensions: Mapping[str, Suspension],
    ) -> None:
        """Make the shapes."""
        self._client, self._body, self._axles = client, body, axles
        # ends on the axle, in the axle's frame, and on the chassis: links, then struts,
        # (6, 3) each
        self._ends: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        for axle in AXLES:
            joints = suspensions[axle].joints
            on_axle, on_chassis = rods(axle)[:, 0], rods(axle)[:, 1]
            placed = joints.pose.place(on_axle) - joints.roll_point
            self._ends[axle] = placed, on_chassis
        self._shapes = [self._shape(part) for part in self._parts()]

    def _shape(self, part: Cylinder) -> int:
        client, (radius, colour) = self._client, part.look
        shape = client.createVisualShape(
            client.GEOM_CYLINDER, radius=radius, length=part.length, rgbaColor=colour
        )
        return client.createMultiBody(0, -1, shape)

    def _parts(self) -> Iterator[Cylinder]:
        """The parts to draw, where the robot now is; their order never changes."""
        client, body = self._client, self._body
        position, turn = client.getBasePositionAndOrientation(body)
        for axle, link in self._axles.items():
            link_position, link_turn = client.getLinkState(body, link, 0, 1)[4:6]
            on_axle, on_chassis = self._ends[axle]
            starts = Rotation.from_quat(turn).apply(on_chassis) + position
            ends = Rotation.from_quat(link_turn).apply(on_axle) + link_position
            for i, (start, end) in enumerate(zip(starts, ends, strict=True)):
                length = float(np.linalg.norm(end - start))
                along = (end - start) / length
                if i < 4:
                    yield Cylinder(LINK, length, (start + end) / 2, along)
                else:
                    tube = start + along * TUBE_LENGTH / 2
                    rod = end - along * ROD_LENGTH / 2
                    yield Cylinder(STRUT_TUBE, TUBE_LENGTH, tube, along)
                    yield Cylinder(STRUT_ROD, ROD_LENGTH, rod, along)

    def place(self) -> None:
        """Move the shapes to where the robot now is."""
        for shape, part in zip(self._shapes, self._parts(), strict=True):
            turn = Rotation.align_vectors(part.direction[None], [[0, 0, 1]])[0]
            self._client.resetBasePositionAndOrientation(
                shape, part.middle.tolist(), turn.as_quat().tolist()
            )
