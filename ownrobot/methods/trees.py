"""Boosted regression trees as tensors: one sequence of trees for each component of y.

`boosting` grows them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

ROWS_AT_A_TIME = 64  # each visits every tree; a processor's cache holds so many


class Forest(NamedTuple):
    """Trees of several regressions, node by node; a leaf is its own child."""

    feature: Tensor  # (n,) int64, the number that a node looks at
    threshold: Tensor  # (n,) float64; a number up to the threshold goes to the left
    missing_left: Tensor  # (n,) bool, whether a missing number (NaN) goes to the left
    left: Tensor  # (n,) int64, the child on the left
    right: Tensor  # (n,) int64, the child on the right
    value: Tensor  # (n,) float64, a leaf's contribution to its component
    roots: Tensor  # (R,) int64, each tree's first node
    component: Tensor  # (R,) int64, the component of y that a tree adds to
    baseline: Tensor  # (Y,) float64, the components without any tree

    @classmethod
    def constant(cls, values: Tensor) -> Forest:
        """A forest without trees that predicts `values` (Y,)."""
        whole = torch.zeros(0, dtype=torch.int64)
        number, flags = whole.double(), whole.bool()
        return cls(
            whole, number, flags, whole, whole, number, whole, whole, values.double()
        )

    def with_trees(
        self, component: int, trees: Sequence[Any], baseline: float
    ) -> Forest:
        """The forest with further trees, and a baseline, that add to a component of y.

        The trees are arrays of nodes, as scikit-learn's histogram trees have them.
        """
        parts = {name: [tensor] for name, tensor in self._asdict().items()}
        first = len(self.feature)
        for nodes in trees:
            own, leaf = torch.arange(len(nodes)), _tensor(nodes["is_leaf"]).bool()
            children = {
                side: first + torch.where(leaf, own, _tensor(nodes[side]).long())
                for side in ("left", "right")
            }
            added = children | {
                "feature": _tensor(nodes["feature_idx"]).long().clamp_min(0),
                "threshold": _tensor(nodes["num_threshold"]).double(),
                "missing_left": _tensor(nodes["missing_go_to_left"]).bool(),
                "value": _tensor(nodes["value"]).double(),
                "roots": torch.tensor([first]),
                "component": torch.tensor([component]),
            }
            for name, tensor in added.items():
                parts[name].append(tensor)
            first += len(nodes)
        joined = {name: torch.cat(tensors) for name, tensors in parts.items()}
        joined["baseline"] = joined["baseline"].clone()
        joined["baseline"][component] += baseline
        return Forest(**joined)

    def predict(self, features: Tensor) -> Tensor:
        """Components (N, Y), float64, at features (N, F), float64."""
        feature = self.feature.int()  # short numbers are read faster
        # Node i has its left child at 2 i, its right one at 2 i + 1.
        children = torch.stack([self.left, self.right], 1).flatten().int()
        parts = [
            self._predict_part(part, feature, children)
            for part in features.split(ROWS_AT_A_TIME)
        ]
        return torch.cat(parts) if parts else self.baseline.expand(0, -1)

    def _predict_part(
        self, features: Tensor, feature: Tensor, children: Tensor
    ) -> Tensor:
        """Components (N, Y) at a few rows; all rows walk down all trees at once."""
        count, width = features.shape
        numbers, has_missing = features.flatten(), bool(features.isnan().any())
        node = self.roots.int().repeat(count)  # (N R,)
        row = torch.arange(count, dtype=torch.int32, device=features.device)
        start = (row * width).repeat_interleave(len(self.roots))
        while True:
            number = numbers.index_select(0, start + feature.index_select(0, node))
            is_right = number > self.threshold.index_select(0, node)
            if has_missing:
                is_right |= number.isnan() & ~self.missing_left.index_select(0, node)
            child = children.index_select(0, 2 * node + is_right)
            if torch.equal(child, node):  # every row is at a leaf of every tree
                break
            node = child
        values = self.value.index_select(0, node).view(count, -1)
        predicted = self.baseline.repeat(count, 1)
        return predicted.index_add_(1, self.component, values)


def _tensor(array: Any) -> Tensor:
    """A tensor with a copy of a field of a structured array."""
    return torch.from_numpy(np.array(array, dtype=np.float64))
