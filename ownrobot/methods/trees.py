"""Boosted regression trees: one sequence of trees for each component of y.

They see x of this step and of the step before, and a dozen numbers of the height map
where the body has one. They predict how much a column changes rather than the column
itself: a sum of steps is a poor copy of a number. `boosting` grows them.
"""

from __future__ import annotations

import torch
from torch import Tensor

from ownrobot.methods.forest import Forest
from ownrobot.methods.map_features import map_features
from sidm.body import Body
from sidm.learning.model import Predictor


class Trees(Predictor):
    """Predicts transitions (B, T, Y) with boosted trees.

    The memory is the last x, (B, 1, X); at a drive's first step the x before is x
    itself.
    """

    scale: Tensor | None

    def __init__(self, body: Body, forest: Forest, scale: Tensor | None = None):
        super().__init__()
        self.body = body
        self.register_buffer("scale", scale, persistent=False)
        for name, tensor in forest._asdict().items():
            tensor = tensor.clone()
            self.register_parameter(name, torch.nn.Parameter(tensor, False))

    @property
    def forest(self) -> Forest:
        """The trees."""
        return Forest(*(getattr(self, name).data for name in Forest._fields))

    def loss_weights(self, role: str) -> Tensor | None:
        """Weights (Y,) of the components in equation (1)."""
        return self.scale

    def forward(
        self, role: str, inputs: Tensor, maps: Tensor, memory: Tensor | None = None
    ):
        """Transitions (B, T, Y) in raw units, and the last x (B, 1, X)."""
        rows = features(inputs, maps, self.body, memory)
        changes = self.forest.predict(rows.flatten(0, 1)).unflatten(0, rows.shape[:2])
        predicted = (changes + kept_columns(inputs, self.body)).to(inputs.dtype)
        return predicted, inputs[:, -1:]


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


def kept_columns(inputs: Tensor, body: Body) -> Tensor:
    """Transitions (B, T, Y), float64: columns keep their values, the pose is 0."""
    end = inputs.shape[-1] - len(body.actions)
    columns = inputs[..., end - len(body.columns) : end].double()
    pose = columns.new_zeros(*columns.shape[:-1], body.pose_size)
    return torch.cat([pose, columns], -1)
