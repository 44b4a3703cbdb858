"""Boosted regression trees: those of a novice, or trees that correct an expert's.

scikit-learn grows one sequence of trees for each component of y; a forest of tensors
predicts with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from ownrobot.methods.closed_form import fitted, weights_of
from ownrobot.methods.fine_tuning import expert_of, pretraining_datasets
from ownrobot.methods.regression import Regression, Samples, joined, samples
from sidm.body import Body
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.training import Trained

#: Standard deviation below which a component counts as constant.
SMALLEST_STD = 1e-9
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


class Growth(NamedTuple):
    """How trees are grown."""

    rounds: int = 300  # trees of a component, at most
    rate: float = 0.05  # factor of a tree's leaves
    leaves: int = 15  # of a tree, at most
    samples: int = 20  # steps at a leaf, at least


#: Of the novice alone or of both robots; of an expert, and of what corrects them. They
#: are the best of a random search on simulated robots with 5 minutes; both robots'
#: samples were not searched for.
NOVICE = Growth()
EXPERT = Growth(rate=0.03, leaves=31, samples=67)
CORRECTION = Growth(rate=0.24, leaves=7, samples=36)
#: A leaf needs at most one of this many steps, so that a few seconds of motion still
#: grow trees.
STEPS_PER_LEAF = 10
#: Trees are counted in groups of this many; a group without a lower loss on the test
#: split is the last.
ROUNDS_AT_A_TIME = 50


def learn(
    datasets: Datasets,
    body: Body,
    scale: Tensor | None = None,
    corrects_expert: bool = False,
    pooled: bool = False,
    seed: int = 0,
) -> Trained:
    """Grow the trees of a novice.

    The number of trees of each component has the lowest loss on the test split, which
    is the test loss; then that many are grown from train and test split together. They
    correct the trees of the expert's motion, or learn from its samples too (`pooled`).
    """
    base = Forest.constant(torch.zeros(len(body.targets)))
    growth = NOVICE
    if corrects_expert:
        alone = pretraining_datasets(datasets, seed)
        base, growth = grow(alone, body, base, EXPERT, seed).forest, CORRECTION
    if pooled:
        train, expert = datasets.train, expert_of(datasets)
        both = Windows(
            torch.cat([train.inputs, expert.inputs]),
            torch.cat([train.targets, expert.targets]),
            torch.cat([train.maps, expert.maps]),
        )
        datasets = datasets._replace(train=both)
    grown = grow(datasets, body, base, growth, seed)
    weights = weights_of(body, scale)
    train_loss, test_loss = (float((weights * part).sum()) for part in grown[1:])
    model = Regression(body, grown.forest, scale=scale)
    steps = sum(part.targets[..., 0].numel() for part in datasets[:2])
    return fitted(model, steps, train_loss, test_loss)


class Grown(NamedTuple):
    """A forest with grown trees, and mean squared errors (Y,) of trees."""

    forest: Forest  # the base with the trees of both splits
    train_errors: Tensor  # of these trees on both splits
    test_errors: Tensor  # on the test split, of the trees of the train split alone


def grow(
    datasets: Datasets, body: Body, base: Forest, growth: Growth, seed: int
) -> Grown:
    """Trees of what a forest leaves of the transitions, added to the forest."""
    import sklearn.ensemble  # noqa: F401 - its OpenMP must be there to be limited
    from threadpoolctl import threadpool_limits

    parts = []
    for windows in datasets[:2]:
        x, y = samples(windows, body)
        parts.append((x, y - base.predict(torch.from_numpy(x)).numpy()))
    forest, errors = base, []
    for component in range(len(body.targets)):
        data = [(x, y[:, component]) for x, y in (*parts, joined(*parts))]
        with threadpool_limits(1, user_api="openmp"):
            trees, baseline, *of_component = _grow_component(data, growth, seed)
        forest = forest.with_trees(component, trees, baseline)
        errors.append(of_component)
    train_errors, test_errors = torch.tensor(errors, dtype=torch.float64).T
    return Grown(forest, train_errors, test_errors)


def _grow_component(
    data: Sequence[Samples], growth: Growth, seed: int
) -> tuple[list[Any], float, float, float]:
    """Nodes of trees, baseline, and errors as in `Grown`, of one component.

    The data are those of the train split, the test split and both.
    """
    train, test, (x, y) = data
    if y.std() < SMALLEST_STD:
        return [], float(y.mean()), float(y.var()), float(test[1].var())
    rounds, test_error = _best_rounds(growth, train, test, seed)
    if not rounds:
        return [], 0.0, float(np.square(y).mean()), test_error
    regressor = _regressor(growth, len(x), seed)
    regressor.set_params(max_iter=rounds).fit(x, y)
    error = float(np.square(regressor.predict(x) - y).mean())
    # scikit-learn has no public way to the nodes; a test holds them to its `predict`.
    trees = [trees_of_round[0].nodes for trees_of_round in regressor._predictors]
    return trees, float(regressor._baseline_prediction.item()), error, test_error


def _best_rounds(
    growth: Growth, train: Samples, test: Samples, seed: int
) -> tuple[int, float]:
    """The number of trees with the lowest error on the test split, and this error.

    0 where no trees are better than any.
    """
    regressor = _regressor(growth, len(train[0]), seed).set_params(
        early_stopping=True,
        scoring="loss",  # half the mean squared error
        n_iter_no_change=2 * ROUNDS_AT_A_TIME - 1,  # the last group is whole then
        tol=0.0,
    )
    regressor.fit(*train, X_val=test[0], y_val=test[1])
    errors = -2 * np.array(regressor.validation_score_)
    errors[0] = np.square(test[1]).mean()  # of no trees
    best = 0
    for rounds in range(ROUNDS_AT_A_TIME, len(errors), ROUNDS_AT_A_TIME):
        best = int(errors[: rounds + 1].argmin())
        if best <= rounds - ROUNDS_AT_A_TIME:
            break
    return best, float(errors[best])


def _regressor(growth: Growth, steps: int, seed: int) -> Any:
    """scikit-learn's regressor, which has not learnt yet."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    return HistGradientBoostingRegressor(
        learning_rate=growth.rate,
        max_leaf_nodes=growth.leaves,
        min_samples_leaf=max(1, min(growth.samples, steps // STEPS_PER_LEAF)),
        early_stopping=False,  # the test split stops it, not a part of the steps
        random_state=seed % 2**32,
        max_iter=growth.rounds,
    )
