"""Boosted regression trees: one sequence of trees for each component of y.

They see x of this step and of the step before, and a dozen numbers of the height map
where the body has one. They learn how much a column changes rather than the column
itself: a sum of steps is a poor copy of a number. scikit-learn grows the trees; a grown
forest needs PyTorch alone.
"""

from __future__ import annotations

import contextlib
import importlib.util
from collections.abc import Iterator
from typing import Any, NamedTuple

import torch
from torch import Tensor

from sidm.body import Body
from sidm.config import ConfigError
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.losses import prediction_loss
from sidm.learning.model import Predictor
from sidm.learning.stopping import CurvePoint
from sidm.learning.training import Trained
from sidm.rivals.fine_tuning import pretraining_datasets
from sidm.rivals.forest import Forest
from sidm.rivals.map_features import map_features

#: Standard deviation below which a component counts as constant.
SMALLEST_STD = 1e-9


class Growth(NamedTuple):
    """How trees are grown."""

    rounds: int = 300  # trees of a component, at most
    rate: float = 0.05  # factor of a tree's leaves
    leaves: int = 15  # of a tree, at most
    samples: int = 20  # steps at a leaf, at least


#: For minutes of the novice's motion, and for the expert's, which there is more of.
NOVICE, EXPERT = Growth(), Growth(rate=0.1, leaves=31)
#: A leaf needs at most one of this many steps, so that a few seconds of motion still
#: grow trees.
STEPS_PER_LEAF = 10
#: Trees are grown in groups of this many; a group without a lower loss on the test
#: split is the last.
ROUNDS_AT_A_TIME = 50


class Trees(Predictor):
    """Predicts transitions (B, T, Y) with boosted trees.

    The memory is the last x, (B, 1, X); at a drive's first step the x before is x
    itself.

    Args:
        body: the robot's body.
        forest: its trees.
        scale: weights (Y,) of the components in equation (1); all 1 by default.
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
    """What the trees see: x, the x of the step before, and the map's features.

    Args:
        inputs: (B, T, X), raw units.
        maps: (B, T, P, P), m.
        body: the robot's body.
        before: (B, 1, X), x of the step before the first; by default x of the first.

    Returns:
        Features (B, T, F), float64.
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


def require_scikit_learn(method: str) -> None:
    """Raise ConfigError, one line, where scikit-learn is not installed."""
    if importlib.util.find_spec("sklearn") is None:
        raise ConfigError(f'{method} needs scikit-learn: pip install "sidm[trees]"')


def learn(
    datasets: Datasets,
    body: Body,
    scale: Tensor | None = None,
    corrects_expert: bool = False,
    seed: int = 0,
) -> Trained:
    """Grow the trees of a novice.

    The number of trees of each component has the lowest loss on the test split; then
    that many are grown from train and test split together.

    Args:
        datasets: the novice's train and test split, and the expert's data for a
            correction; the validation set is not used.
        body: the robot's body.
        scale: weights (Y,) of the components in equation (1); all 1 by default.
        corrects_expert: whether the trees correct the trees of the expert's motion.
        seed: of scikit-learn's draws and the split of the expert's data.

    Returns:
        The model and its training; the test loss is that of the trees of the train
        split.

    Raises:
        ConfigError: scikit-learn is not installed, or there are no data of the expert
            where the trees correct its trees; one line.
    """
    require_scikit_learn("trees_corrected" if corrects_expert else "trees")
    base = Forest.constant(torch.zeros(len(body.targets)))
    with _one_openmp_thread():
        if corrects_expert:
            expert = pretraining_datasets(datasets, seed)
            base, _ = grow(expert, body, base, EXPERT, seed)
        forest, of_train = grow(datasets, body, base, NOVICE, seed)
    losses, model = [], Trees(body, of_train, scale)
    for windows in (datasets.train, datasets.test):
        predicted, _ = model("novice", windows.inputs, windows.maps)
        losses.append(float(prediction_loss(predicted, windows.targets, scale).mean()))
    steps = sum(
        part.targets[..., 0].numel() for part in (datasets.train, datasets.test)
    )
    curve = [CurvePoint(steps, losses[0], losses[1], None)]
    model = Trees(body, forest, scale).eval()
    return Trained(model, curve, steps, 0, losses[1], steps, True)


def grow(
    datasets: Datasets, body: Body, base: Forest, growth: Growth, seed: int
) -> tuple[Forest, Forest]:
    """Trees of what a forest leaves of the transitions, added to the forest.

    Args:
        datasets: the train and test split are used.
        body: the robot's body.
        base: the forest that is corrected.
        growth: how the trees are grown.
        seed: of scikit-learn's draws.

    Returns:
        The forest with trees of both splits, and with trees of the train split alone.
    """
    x, y = _features_and_changes(datasets.train, body)
    x_test, y_test = _features_and_changes(datasets.test, body)
    residuals, test_residuals = y - base.predict(x), y_test - base.predict(x_test)
    x_all, all_residuals = (
        torch.cat([x, x_test]),
        torch.cat([residuals, test_residuals]),
    )
    forest = of_train = base
    for component in range(y.shape[1]):
        known, unseen = residuals[:, component], test_residuals[:, component]
        every = all_residuals[:, component]
        if float(y[:, component].std(correction=0)) < SMALLEST_STD:
            of_train = of_train.with_trees(component, [], float(known.mean()))
            forest = forest.with_trees(component, [], float(every.mean()))
            continue
        regressor = _regressor(growth, len(x), seed)
        rounds = _fit_rounds(regressor, growth.rounds, (x, known), (x_test, unseen))
        of_train = of_train.with_trees(component, *_trees(regressor, rounds))
        regressor = _regressor(growth, len(x_all), seed)
        regressor.set_params(max_iter=rounds).fit(x_all.numpy(), every.numpy())
        forest = forest.with_trees(component, *_trees(regressor, rounds))
    return forest, of_train


def _features_and_changes(windows: Windows, body: Body) -> tuple[Tensor, Tensor]:
    """Features (N, F) and what the trees learn (N, Y), float64, of all steps."""
    rows = features(windows.inputs, windows.maps, body)
    changes = windows.targets.double() - kept_columns(windows.inputs, body)
    return rows.flatten(0, 1), changes.flatten(0, 1)


def _fit_rounds(
    regressor: Any, most: int, train: tuple[Tensor, Tensor], test: tuple[Tensor, Tensor]
) -> int:
    """Fit a regressor until its error on the test split has stopped to fall.

    Args:
        regressor: scikit-learn's.
        most: rounds at most.
        train: features (N, F) and what is learnt (N,).
        test: the same of the test split.

    Returns:
        The number of rounds with the lowest error on the test split.
    """
    best = 0
    for rounds in range(ROUNDS_AT_A_TIME, most + 1, ROUNDS_AT_A_TIME):
        regressor.set_params(max_iter=rounds, warm_start=True)
        regressor.fit(*(part.numpy() for part in train))
        errors = [
            float((torch.from_numpy(predicted) - test[1]).square().mean())
            for predicted in regressor.staged_predict(test[0].numpy())
        ]
        best = errors.index(min(errors)) + 1
        if best <= rounds - ROUNDS_AT_A_TIME:
            break
    return best


def _regressor(growth: Growth, steps: int, seed: int) -> Any:
    """scikit-learn's regressor, which has not learnt yet."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    return HistGradientBoostingRegressor(
        learning_rate=growth.rate,
        max_leaf_nodes=growth.leaves,
        min_samples_leaf=max(1, min(growth.samples, steps // STEPS_PER_LEAF)),
        early_stopping=False,  # the test split stops it, not a part of the steps
        random_state=seed,
    )


def _trees(regressor: Any, rounds: int) -> tuple[list[Any], float]:
    """Nodes of the first trees of a regressor, and its baseline."""
    # scikit-learn has no public way to the nodes; a test holds them to its `predict`.
    trees = [trees_of_round[0].nodes for trees_of_round in regressor._predictors]
    return trees[:rounds], float(regressor._baseline_prediction.item())


@contextlib.contextmanager
def _one_openmp_thread() -> Iterator[None]:
    """scikit-learn grows trees on one thread inside the block."""
    import sklearn.ensemble  # noqa: F401 - its OpenMP must be there to be limited
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, user_api="openmp"):
        yield
