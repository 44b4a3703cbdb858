"""Random rocky terrain: a grid of heights, and the surface that it describes.

The method is the authors' released one (section 4 of the paper shows its result): every
grid point takes the height of its nearest random centre, the steps are smoothed, finer
noise is added and the start is levelled. It needs NumPy and SciPy only.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from sidm.systems import Terrain

# Perlin's gradients (2, 12): the directions from a cube's centre to its twelve edges,
# seen along one axis.
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
    """Gradient noise (Perlin, 2002), with a random gradient at each lattice point.

    Values at coordinates x and y, m, which broadcast, are within +-1 and 0 on the
    lattice points, of which `frequency` are in a metre.
    """
    x, y = x * frequency, y * frequency
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    u, v = x - column, y - row  # position inside the lattice's cell, 0 to 1
    column, row = column - column.min(), row - row.min()
    lattice = row.max() + 2, column.max() + 2
    east, north = CUBE_EDGES[:, rng.integers(12, size=lattice)]

    def corner(i: int, j: int) -> np.ndarray:
        at = row + j, column + i
        return east[at] * (u - i) + north[at] * (v - j)

    fade_u, fade_v = (t * t * t * (t * (6 * t - 15) + 10) for t in (u, v))
    south = corner(0, 0) + fade_u * (corner(1, 0) - corner(0, 0))
    north_side = corner(0, 1) + fade_u * (corner(1, 1) - corner(0, 1))
    return south + fade_v * (north_side - south)


def cell_heights(
    terrain: Terrain, x: np.ndarray, y: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Heights (H, W), m, of the Voronoi cells of (x[j], y[i]); one at the start."""
    half = terrain.half_width
    count = round(terrain.cells_per_area * (2 * half) ** 2)
    centres = rng.uniform(-half, half, (count, 2))
    centres = centres[np.hypot(*centres.T) > terrain.start_cell_radius]
    centres = np.vstack([centres, np.zeros(2)])
    noise = perlin(centres[:, 0], centres[:, 1], terrain.cell_frequency, rng)
    points = np.stack(np.meshgrid(x, y), axis=-1)  # (H, W, 2)
    _, nearest = cKDTree(centres).query(points)
    return (terrain.cell_height_scale * noise)[nearest]


def level_start(
    terrain: Terrain, heights: np.ndarray, x: np.ndarray, y: np.ndarray
) -> np.ndarray:
    """Heights (H, W), m, with a level disc at the origin that blends into the rest."""
    distance = np.hypot(x, y[:, None])
    level = heights[distance < terrain.flat_radius].mean()
    rough = np.clip((distance - terrain.flat_radius) / terrain.blend, 0, 1)
    return level + rough * (heights - level)


def generate_terrain(terrain: Terrain, seed: int) -> np.ndarray:
    """Heights (size, size), m, index [y, x], of the ground that a seed stands for.

    The grid is centred on the origin; the lowest height is 0; the type is float64.
    Equal arguments give equal heights.
    """
    rng = np.random.default_rng(seed)
    x = (np.arange(terrain.size) - (terrain.size - 1) / 2) * terrain.spacing
    steps = cell_heights(terrain, x, x, rng)
    heights = gaussian_filter(steps, terrain.smoothing, mode="nearest")
    noise = perlin(x, x[:, None], terrain.noise_frequency, rng)
    heights += terrain.noise_height_scale * noise
    heights = level_start(terrain, heights, x, x)
    return heights - heights.min()


def height_at(
    heights: np.ndarray, x: np.ndarray, y: np.ndarray, spacing: float = 0.1
) -> np.ndarray:
    """Heights, m, of the surface that the wheels touch: two triangles in a grid cell.

    The grid of heights (H, W), m, index [y, x], is centred on the origin. World
    coordinates x and y, m, broadcast; outside of the grid the border holds.
    """
    rows, columns = heights.shape
    across = np.clip(np.asarray(x) / spacing + (columns - 1) / 2, 0, columns - 1)
    along = np.clip(np.asarray(y) / spacing + (rows - 1) / 2, 0, rows - 1)
    j = np.minimum(across.astype(int), columns - 2)
    i = np.minimum(along.astype(int), rows - 2)
    u, v = across - j, along - i
    # Bullet cuts each cell along the diagonal from (0, 1) to (1, 0) into two triangles.
    south_west, south_east = heights[i, j], heights[i, j + 1]
    north_west, north_east = heights[i + 1, j], heights[i + 1, j + 1]
    below = south_west + u * (south_east - south_west) + v * (north_west - south_west)
    above = north_east + (1 - u) * (north_west - north_east)
    above = above + (1 - v) * (south_east - north_east)
    return np.where(u + v <= 1, below, above)
