"""The terrain in Bullet: a height field whose heights can be replaced."""

from __future__ import annotations

import numpy as np

from sidm.simulation.client import Client
from sidm.systems import GRID_SPACING, Physics

MAX_HEIGHT = 100.0  # m, bound of the heights' absolute values
COLOUR = (0.78, 0.74, 0.68, 1.0)  # red, green, blue, opacity, in pictures


class HeightField:
    """The body in Bullet that the robot drives on, with heights (H, W), m, float64.

    They can be replaced: building a new height field takes Bullet twice as long,
    because Bullet then prepares to draw it.
    """

    def __init__(
        self, client: Client, heights: np.ndarray, physics: Physics, visible: bool
    ) -> None:
        self._client, self._visible = client, visible
        self.heights = _checked(heights)
        # Bullet keeps the bounds of the heights that a shape is built with. These
        # bounds hold for all heights and are symmetric about the body's origin.
        bounds = np.zeros(self.heights.shape)
        bounds.flat[[0, -1]] = -MAX_HEIGHT, MAX_HEIGHT
        self._shape = self._height_field(bounds)
        self._height_field(self.heights, replaceHeightfieldIndex=self._shape)
        # Without a visual shape PyBullet would draw all triangles, which takes as long
        # as building them.
        hidden = client.createVisualShape(client.GEOM_SPHERE, radius=1e-3)
        body = client.createMultiBody(0, self._shape, hidden)
        client.changeVisualShape(body, -1, rgbaColor=COLOUR)
        client.changeDynamics(
            body,
            -1,
            restitution=0.0,
            lateralFriction=physics.ground_friction,
            collisionMargin=physics.contact_margin,
            contactStiffness=physics.contact_stiffness,
            contactDamping=physics.contact_damping,
        )
        if visible:
            self._draw()

    def _height_field(self, heights: np.ndarray, **options: int) -> int:
        """Build a shape of heights (H, W), m, in Bullet; returns its number."""
        rows, columns = heights.shape
        return self._client.createCollisionShape(
            self._client.GEOM_HEIGHTFIELD,
            meshScale=[GRID_SPACING, GRID_SPACING, 1.0],
            heightfieldData=heights.astype(np.float32).ravel().tolist(),
            numHeightfieldRows=columns,  # what Bullet calls rows runs along x
            numHeightfieldColumns=rows,
            **options,
        )

    def _draw(self) -> None:
        """Add a body that is drawn: Bullet would draw the first one's first heights."""
        client = self._client
        # Bullet puts the middle of the heights' range at the body's origin
        middle = (self.heights.max() + self.heights.min()) / 2
        picture = client.createMultiBody(
            0, self._height_field(self.heights), basePosition=[0, 0, middle]
        )
        client.changeVisualShape(picture, -1, rgbaColor=COLOUR, textureUniqueId=-1)
        client.setCollisionFilterGroupMask(picture, -1, 0, 0)

    def replace(self, heights: np.ndarray) -> None:
        """Replace the heights by others (H, W), m, of the same shape."""
        heights = _checked(heights)
        if self._visible or heights.shape != self.heights.shape:
            where = " where it is visible" if self._visible else ""
            raise ValueError(
                f"a terrain of shape {self.heights.shape} cannot be replaced by one "
                f"of {heights.shape}{where}: build a new Simulator"
            )
        self.heights = heights
        self._height_field(heights, replaceHeightfieldIndex=self._shape)


def _checked(heights: np.ndarray) -> np.ndarray:
    """Heights (H, W), m, as float64; ValueError where they are no grid or too large."""
    heights = np.asarray(heights, float)
    grid = heights.ndim == 2 and min(heights.shape) >= 2
    if not grid or not (np.abs(heights) < MAX_HEIGHT).all():
        raise ValueError(
            f"heights must be finite, within {MAX_HEIGHT:.0f} m of 0, "
            f"of shape (H, W), (2, 2) or more, not {heights.shape}"
        )
    return heights
