"""The terrain in Bullet: a height field whose heights can be exchanged."""

from __future__ import annotations

import numpy as np

from sidm.simulation.client import Client
from sidm.systems import GRID_SPACING, Physics

HIGHEST = 100.0  # m: heights lie between this and its negative
COLOUR = (0.78, 0.74, 0.68, 1.0)  # in pictures


class Ground:
    """A body that the robot drives on.

    Building a height field takes Bullet twice as long as exchanging its heights, for it
    prepares to draw them.

    Attributes:
        heights: (H, W), m, float64.
        body: its number in Bullet.
    """

    def __init__(
        self, client: Client, heights: np.ndarray, physics: Physics, visible: bool
    ) -> None:
        """Build it from heights (H, W), m; pictures show it if `visible`."""
        self._client, self._visible = client, visible
        self.heights = _checked(heights)
        # Bullet keeps the bounds of a shape's first heights: these leave room for any
        # others, about the body's origin.
        room = np.zeros(self.heights.shape)
        room.flat[[0, -1]] = -HIGHEST, HIGHEST
        self._shape = self._height_field(room)
        self._height_field(self.heights, replaceHeightfieldIndex=self._shape)
        # Without a shape of its own to show, PyBullet would draw all triangles, which
        # takes as long as building them.
        hidden = client.createVisualShape(client.GEOM_SPHERE, radius=1e-3)
        self.body = client.createMultiBody(0, self._shape, hidden)
        client.changeVisualShape(self.body, -1, rgbaColor=COLOUR)
        client.changeDynamics(
            self.body,
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
        """A shape of the given heights in Bullet, its number."""
        rows, columns = heights.shape
        return self._client.createCollisionShape(
            self._client.GEOM_HEIGHTFIELD,
            meshScale=[GRID_SPACING, GRID_SPACING, 1.0],
            heightfieldData=heights.astype(np.float32).ravel().tolist(),
            numHeightfieldRows=columns,  # Bullet's rows run along x
            numHeightfieldColumns=rows,
            **options,
        )

    def _draw(self) -> None:
        """A second body to be looked at, which nothing touches: of the first, Bullet would draw the first heights."""
        client = self._client
        # Bullet puts the middle of the heights' range at the body's origin.
        middle = (self.heights.max() + self.heights.min()) / 2
        picture = client.createMultiBody(
            0, self._height_field(self.heights), basePosition=[0, 0, middle]
        )
        client.changeVisualShape(picture, -1, rgbaColor=COLOUR, textureUniqueId=-1)
        client.setCollisionFilterGroupMask(picture, -1, 0, 0)

    def exchange(self, heights: np.ndarray) -> None:
        """Take other heights (H, W), m, of the same shape.

        Raises:
            ValueError: another shape, not finite or too high; or the ground is visible.
        """
        heights = _checked(heights)
        if self._visible or heights.shape != self.heights.shape:
            raise ValueError(
                f"a terrain of shape {self.heights.shape} cannot be exchanged for one of {heights.shape}"
                f"{' where it is visible' if self._visible else ''}: build a new Simulator"
            )
        self.heights = heights
        self._height_field(heights, replaceHeightfieldIndex=self._shape)

    def ray_heights(self, points: np.ndarray) -> np.ndarray:
        """Heights (N,), m, where vertical rays at `points` (N, 2), m, meet it; NaN where they miss or hit the robot."""
        top, bottom = self.heights.max() + 1, self.heights.min() - 1
        hits: list[float] = []
        for some in np.array_split(
            points, -(-len(points) // self._client.MAX_RAY_INTERSECTION_BATCH_SIZE)
        ):
            rays = self._client.rayTestBatch(
                [[*p, top] for p in some], [[*p, bottom] for p in some]
            )
            hits += [hit[3][2] if hit[0] == self.body else np.nan for hit in rays]
        return np.array(hits)


def _checked(heights: np.ndarray) -> np.ndarray:
    heights = np.asarray(heights, float)
    if (
        heights.ndim != 2
        or min(heights.shape) < 2
        or not (np.abs(heights) < HIGHEST).all()
    ):
        raise ValueError(
            f"heights must be finite, within {HIGHEST:.0f} m of 0, of shape (H, W), (2, 2) or more, not {heights.shape}"
        )
    return heights
