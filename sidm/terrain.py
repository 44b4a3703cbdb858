"""Random rocky terrain: a grid of heights, and the surface that it stands for.

The recipe is the authors' released one (section 4 of the paper shows its result): every
grid point takes the height of its nearest random centre, the steps are smoothed, finer
noise is added and the start is levelled. NumPy and SciPy only.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from sidm.systems import Terrain

# Perlin's gradients, the directions from a cube's centre to its twelve edges, seen
# along one axis: (2, 12).
CUBE_EDGES = np.array(
    [
        [1, -1, 1, -1, 1, 1, -1, -1, 0, 0, 0, 0],
        [1, 1, -1, -1, 0, 0, 0, 0, 1, 1, -1, -1],
    ],
    float,
)


def perlin(
    x: np.ndarray, y: np.ndarray, frequency: float, rng: np.random.Generator
) -> np.ndarray:
    """Gradient noise (Perlin, 2002) at points (...,), m, with one random gradient on each point of a lattice.

    Args:
        x: coordinates, m, of any shape.
        y: coordinates, m, of the same shape as `x` or broadcasting with it.
        frequency: lattice points a metre.
        rng: draws the gradients of the lattice around the points.

    Returns:
        Values of the broadcast shape, within +-1, 0 on the lattice points.
    """
    x, y = x * frequency, y * frequency
    left, low = np.floor(x).astype(int), np.floor(y).astype(int)
    u, v = x - left, y - low
    left, low = left - left.min(), low - low.min()
    east, north = CUBE_EDGES[:, rng.integers(12, size=(low.max() + 2, left.max() + 2))]

    def corner(i: int, j: int) -> np.ndarray:
        return east[low + j, left + i] * (u - i) + north[low + j, left + i] * (v - j)

    fade_u, fade_v = (t * t * t * (t * (6 * t - 15) + 10) for t in (u, v))
    south = corner(0, 0) + fade_u * (corner(1, 0) - corner(0, 0))
    return south + fade_v * (
        corner(0, 1) + fade_u * (corner(1, 1) - corner(0, 1)) - south
    )


def cell_heights(
    terrain: Terrain, x: np.ndarray, y: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Heights (H, W), m, of the Voronoi cells that the grid points (x[j], y[i]) lie in; the start is one cell."""
    half = terrain.half_width
    count = round(terrain.cells_per_area * (2 * half) ** 2)
    centres = rng.uniform(-half, half, (count, 2))
    centres = centres[np.hypot(*centres.T) > terrain.start_cell_radius]
    centres = np.vstack([centres, np.zeros(2)])
    values = terrain.cell_height_scale * perlin(
        centres[:, 0], centres[:, 1], terrain.cell_frequency, rng
    )
    grid = np.stack(np.meshgrid(x, y), axis=-1)  # (H, W, 2)
    return values[cKDTree(centres).query(grid)[1]]


def level_start(
    terrain: Terrain, heights: np.ndarray, x: np.ndarray, y: np.ndarray
) -> np.ndarray:
    """`heights` (H, W) with a level disc at the origin, blended back into the rough ground around it."""
    distance = np.hypot(x, y[:, None])
    level = heights[distance < terrain.flat_radius].mean()
    rough = np.clip((distance - terrain.flat_radius) / terrain.blend, 0, 1)
    return level + rough * (heights - level)


def generate_terrain(terrain: Terrain, seed: int) -> np.ndarray:
    """Heights (size, size), float64, m, index [y, x], centred on the origin, lowest 0: a function of its arguments."""
    rng = np.random.default_rng(seed)
    x = (np.arange(terrain.size) - (terrain.size - 1) / 2) * terrain.spacing
    heights = gaussian_filter(
        cell_heights(terrain, x, x, rng), terrain.smoothing, mode="nearest"
    )
    heights += terrain.noise_height_scale * perlin(
        x, x[:, None], terrain.noise_frequency, rng
    )
    heights = level_start(terrain, heights, x, x)
    return heights - heights.min()


def height_at(
    heights: np.ndarray, x: np.ndarray, y: np.ndarray, spacing: float = 0.1
) -> np.ndarray:
    """Height of the ground at points, m: the surface the wheels touch, two triangles to a grid cell.

    Args:
        heights: (H, W), m, index [y, x], centred on the origin.
        x: world coordinates, m, of any shape; outside the grid the border's height
            holds.
        y: the same.
        spacing: between grid points, m.

    Returns:
        Heights of the broadcast shape of `x` and `y`.
    """
    rows, columns = heights.shape
    across = np.clip(np.asarray(x) / spacing + (columns - 1) / 2, 0, columns - 1)
    along = np.clip(np.asarray(y) / spacing + (rows - 1) / 2, 0, rows - 1)
    j = np.minimum(across.astype(int), columns - 2)
    i = np.minimum(along.astype(int), rows - 2)
    u, v = across - j, along - i
    # Bullet cuts each cell from (0, 1) to (1, 0): below that diagonal one triangle,
    # above it the other.
    near = (
        heights[i, j]
        + u * (heights[i, j + 1] - heights[i, j])
        + v * (heights[i + 1, j] - heights[i, j])
    )
    far = heights[i + 1, j + 1] + (1 - u) * (heights[i + 1, j] - heights[i + 1, j + 1])
    far = far + (1 - v) * (heights[i, j + 1] - heights[i + 1, j + 1])
    return np.where(u + v <= 1, near, far)
