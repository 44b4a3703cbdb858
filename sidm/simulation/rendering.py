"""What pictures show beside the simulation's bodies: links and struts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from sidm.simulation.dimensions import AXLES
from sidm.simulation.linkage import rods
from sidm.simulation.suspension import Suspension

LINK = (0.006, (0.35, 0.36, 0.38, 1.0))  # radius, m, and colour
STRUT_TUBE, STRUT_ROD = (
    (0.013, (0.0, 0.45, 0.70, 1.0)),
    (0.006, (0.85, 0.85, 0.87, 1.0)),
)
#: m, the halves of a strut, which is 0.16 m long at zero travel
TUBE_LENGTH, ROD_LENGTH = 0.095, 0.110


class DrawnRods:
    """The links and struts of both axles as shapes without mass or contact, moved to their places for each picture."""

    def __init__(
        self,
        client: Any,
        body: int,
        axles: Mapping[str, int],
        suspensions: Mapping[str, Suspension],
    ) -> None:
        """Make the shapes.

        Args:
            client: Bullet's functions.
            body: the robot.
            axles: the link of the robot that is its 'rear', its 'front' axle.
            suspensions: of the two axles.
        """
        self._client, self._body, self._axles = client, body, axles
        # ends on the axle in the axle's own frame, and on the chassis: links, then
        # struts, (6, 3) each
        self._ends = {
            axle: (
                suspensions[axle].joints.pose.place(rods(axle)[:, 0])
                - suspensions[axle].joints.roll_point,
                rods(axle)[:, 1],
            )
            for axle in AXLES
        }
        self._shapes = [
            self._shape(*look, length) for look, length, _, _ in self._parts()
        ]

    def _shape(self, radius: float, colour: tuple[float, ...], length: float) -> int:
        client = self._client
        return client.createMultiBody(
            0,
            -1,
            client.createVisualShape(
                client.GEOM_CYLINDER, radius=radius, length=length, rgbaColor=colour
            ),
        )

    def _parts(
        self,
    ) -> Iterator[
        tuple[tuple[float, tuple[float, ...]], float, np.ndarray, np.ndarray]
    ]:
        """Of each shape: its look, its length, its middle and its direction in the world."""
        position, turn = self._client.getBasePositionAndOrientation(self._body)
        for axle, link in self._axles.items():
            link_position, link_turn = self._client.getLinkState(
                self._body, link, 0, 1
            )[4:6]
            own, sprung = self._ends[axle]
            starts = Rotation.from_quat(turn).apply(sprung) + position
            ends = Rotation.from_quat(link_turn).apply(own) + link_position
            for i, (start, end) in enumerate(zip(starts, ends, strict=True)):
                length = float(np.linalg.norm(end - start))
                along = (end - start) / length
                if i < 4:
                    yield LINK, length, (start + end) / 2, along
                else:
                    yield (
                        STRUT_TUBE,
                        TUBE_LENGTH,
                        start + along * TUBE_LENGTH / 2,
                        along,
                    )
                    yield STRUT_ROD, ROD_LENGTH, end - along * ROD_LENGTH / 2, along

    def place(self) -> None:
        """Move the shapes to where the robot now is."""
        for shape, (_, _, middle, along) in zip(
            self._shapes, self._parts(), strict=True
        ):
            turn = Rotation.align_vectors(along[None], [[0, 0, 1]])[0]
            self._client.resetBasePositionAndOrientation(
                shape, middle.tolist(), turn.as_quat().tolist()
            )
