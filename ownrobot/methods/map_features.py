"""A dozen numbers of a height map, for methods that do not look at pictures."""

from __future__ import annotations

import functools

import torch
from torch import Tensor

#: Radius around the robot in which height, slopes and curvature are measured, m.
NEAR = 1.0
CELL = 1.0  # side of a cell, m

#: Names of the numbers; a cell's name is its place: ahead is +, left is +.
NAMES = (
    "height",
    "slope along",
    "slope across",
    "curvature",
    *(f"cell {ahead:+d} {left:+d}" for left in (-1, 0, 1) for ahead in (-1, 0, 1)),
)


def map_features(maps: Tensor, size: float) -> Tensor:
    """Features (..., 13), float32, in the order of NAMES, of maps (..., P, P), m.

    Height (m), slopes along and across the robot (-) and curvature (1/m) are those of
    the paraboloid h + a x + b y + c (x^2 + y^2) / 2 that fits the map within a metre of
    the robot best. The cells are squares of about 1 m, three by three, with the robot
    in the middle.
    """
    weights = _feature_weights(maps.shape[-1], size).to(maps.device)
    return maps.flatten(-2).float() @ weights.T


@functools.lru_cache(maxsize=8)
def _feature_weights(pixels: int, size: float) -> Tensor:
    """Weights (13, P * P), float32: each feature is a weighted sum of the pixels."""
    places = ((torch.arange(pixels, dtype=torch.float64) + 0.5) / pixels - 0.5) * size
    y, x = (grid.flatten() for grid in torch.meshgrid(places, places, indexing="ij"))
    squares = x.square() + y.square()
    # A coarse map needs its middle.
    near = squares <= max(NEAR, 1.5 * (size / pixels)) ** 2
    terms = torch.stack([torch.ones_like(x), x, y, squares / 2], 1)
    paraboloid = x.new_zeros(4, len(x))
    paraboloid[:, near] = torch.linalg.pinv(terms[near])
    side = min(CELL, size / 3)
    cells = []
    for left in (-1, 0, 1):
        for ahead in (-1, 0, 1):
            distance = torch.maximum((x - ahead * side).abs(), (y - left * side).abs())
            # A coarse map may have no pixel in the cell: the nearest ones count.
            inside = distance <= max(side / 2, float(distance.min())) + 1e-9
            cells.append(inside / inside.sum())
    return torch.cat([paraboloid, torch.stack(cells)]).float()
