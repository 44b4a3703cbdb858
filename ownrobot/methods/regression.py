"""A model of one regression for each component of y: boosted trees, Gaussian processes.

It sees x of this step and of the step before, and a dozen numbers of the height map
where the body has one. It predicts how much a column changes rather than the column
itself: a sum of steps is a poor copy of a number. scikit-learn finds the regressions;
predictions and storage need PyTorch alone.
"""

from __future__ import annotations

import functools
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor

from ownrobot.methods.closed_form import ClosedForm, columns_and_actions
from sidm.body import Body
from sidm.learning.dataset import Windows
from sidm.learning.model import Predictor

#: Features (n, F), and what is left of the transitions (n, Y), both float64.
Samples = tuple[np.ndarray, np.ndarray]
#: Radius around the robot in which height, slopes and curvature are measured, m.
NEAR = 1.0
CELL = 1.0  # side of a cell of the height map, m


class Regressions(Protocol):
    """Regressions of all components, whose tensors have names."""

    def predict(self, features: Tensor) -> Tensor:
        """Components (N, Y), float64, at features (N, F), float64."""
        ...

    def _asdict(self) -> dict[str, Tensor]: ...


class Regression(ClosedForm):
    """Predicts transitions (B, T, Y) by regressions, which are trees or processes.

    They correct a base, the expert's model without a memory, or predict the changes of
    columns. The memory is the last x, (B, 1, X); at a drive's first step the x before
    is x itself.
    """

    def __init__(
        self,
        body: Body,
        regressions: Regressions,
        base: Predictor | None = None,
        scale: Tensor | None = None,
    ):
        super().__init__(scale)
        self.body, self.base = body, base
        self.kind: Any = type(regressions)
        for name, tensor in regressions._asdict().items():  # which are not trained
            self.register_parameter(name, torch.nn.Parameter(tensor.clone(), False))
        self.names = list(regressions._asdict())

    def forward(
        self, role: str, inputs: Tensor, maps: Tensor, memory: Tensor | None = None
    ):
        """Transitions (B, T, Y) in raw units, and the last x (B, 1, X)."""
        rows = features(inputs, maps, self.body, memory)
        regressions = self.kind(*(getattr(self, name).data for name in self.names))
        changes = regressions.predict(rows.flatten(0, 1)).unflatten(0, rows.shape[:2])
        predicted = _first_guess(inputs, maps, self.body, self.base) + changes
        return predicted.to(inputs.dtype), inputs[:, -1:]


def features(
    inputs: Tensor, maps: Tensor, body: Body, before: Tensor | None = None
) -> Tensor:
    """Features (B, T, F), float64: x, the x of the step before, and the map's features.

    Inputs are (B, T, X), maps (B, T, P, P), m; `before` (B, 1, X) is x of the step
    before the first, by default x of the first.
    """
    first = inputs[:, :1] if before is None else before
    parts = [inputs, torch.cat([first, inputs[:, :-1]], 1)]
    if body.map_size:
        parts.append(map_features(maps, body.map_size))
    return torch.cat(parts, -1).double()


def map_features(maps: Tensor, size: float) -> Tensor:
    """Features (..., 13), float32, of maps (..., P, P), m, with sides of `size`, m.

    Height (m), slopes along and across the robot (-) and curvature (1/m) are those of
    the paraboloid h + a x + b y + c (x^2 + y^2) / 2 that fits the map within a metre of
    the robot best. The other nine are means of square cells of about 1 m, m, three by
    three with the robot in the middle: from right to left, each from behind to ahead.
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


def samples(windows: Windows, body: Body, base: Predictor | None = None) -> Samples:
    """Features of all steps, and what is left of their transitions."""
    rows = features(windows.inputs, windows.maps, body).flatten(0, 1)
    begun = _first_guess(windows.inputs, windows.maps, body, base)
    residuals = (windows.targets.double() - begun).flatten(0, 1)
    return rows.numpy(), residuals.numpy()


def joined(first: Samples, second: Samples) -> Samples:
    """Samples of both, the first ones first."""
    return np.concatenate([first[0], second[0]]), np.concatenate([first[1], second[1]])


def _first_guess(
    inputs: Tensor, maps: Tensor, body: Body, base: Predictor | None
) -> Tensor:
    """What is added to, (B, T, Y), float64: a base, or columns as they are, pose 0."""
    if base is not None:
        with torch.inference_mode():
            predicted, _ = base("novice", inputs, maps)
        return predicted.double()
    columns = columns_and_actions(inputs, body)[0].double()
    pose = columns.new_zeros(*columns.shape[:-1], body.pose_size)
    return torch.cat([pose, columns], -1)
