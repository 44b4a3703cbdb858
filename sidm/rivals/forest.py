"""Boosted regression trees as tensors: predictions and storage need PyTorch alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

ROWS_AT_A_TIME = 256  # each visits every tree; a processor's cache holds so many


class Forest(NamedTuple):
    """Trees of several regressions, node by node; a leaf is its own child.

    Attributes:
        feature: (n,) int64, the number that a node looks at
        threshold: (n,) float64; a number up to the threshold goes to the left
        missing_left: (n,) bool, whether a missing number (NaN) goes to the left
        left: (n,) int64, the child on the left
        right: (n,) int64, the child on the right
        value: (n,) float64, a leaf's contribution to its component
        roots: (R,) int64, each tree's first node
        component: (R,) int64, the component of y that a tree adds to
        baseline: (Y,) float64, the components without any tree
    """

    feature: Tensor
    threshold: Tensor
    missing_left: Tensor
    left: Tensor
    right: Tensor
    value: Tensor
    roots: Tensor
    component: Tensor
    baseline: Tensor

    @classmethod
    def constant(cls, values: Tensor) -> Forest:
        """A forest without trees that predicts `values` (Y,)."""
        whole = torch.zeros(0, dtype=torch.int64)
        number = torch.zeros(0, dtype=torch.float64)
        flags = torch.zeros(0, dtype=torch.bool)
        return cls(
            whole, number, flags, whole, whole, number, whole, whole, values.double()
        )

    def with_trees(
        self, component: int, trees: Sequence[Any], baseline: float
    ) -> Forest:
        """The forest with further trees that add to a component of y.

        Args:
            component: number of the component.
            trees: NumPy arrays of nodes, as scikit-learn's histogram trees have them.
            baseline: is added to the component too.
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
        parts = [self._predict_part(part) for part in features.split(ROWS_AT_A_TIME)]
        return torch.cat(parts) if parts else self.baseline.expand(0, -1)

    def _predict_part(self, features: Tensor) -> Tensor:
        """Components (N, Y) at a few rows."""
        node = self.roots.expand(len(features), -1)  # (N, R)
        has_missing = bool(features.isnan().any())
        while True:
            number = features.gather(1, self.feature[node])
            is_left = number <= self.threshold[node]
            if has_missing:
                is_left |= number.isnan() & self.missing_left[node]
            child = torch.where(is_left, self.left[node], self.right[node])
            if torch.equal(child, node):  # every row is at a leaf of every tree
                break
            node = child
        predicted = self.baseline.repeat(len(features), 1)
        return predicted.index_add_(1, self.component, self.value[node])


def _tensor(array: Any) -> Tensor:
    """A tensor with a copy of a field of a structured array."""
    return torch.from_numpy(np.array(array, dtype=np.float64))
