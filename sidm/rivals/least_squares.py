"""A novice by least squares: what the expert's model gets wrong, or the whole transition, as a sum of few functions.

The functions are a constant, the 11 numbers of x, the 13 of the expert's prediction
where there is one, and all products of two of these. Their weights have a closed form,
so that a novice is learnt in seconds. How strongly weights are held back (ridge
regression), those of products apart from the others, is chosen by cross-validation.
"""

from __future__ import annotations

import functools
import itertools
import operator
from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor, nn

from sidm.learning.dataset import Datasets, Windows
from sidm.learning.evaluation import EVALUATION_BATCH
from sidm.learning.model import DynamicsModel, Predictor
from sidm.learning.networks import Memory
from sidm.learning.stopping import Tested
from sidm.learning.training import Trained
from sidm.learning.units import Standardisation

FOLDS = 5  # of the cross-validation, at most
#: of weights of the numbers themselves
PENALTIES = tuple(10.0**power for power in range(-4, 1))
#: of weights of their products
PRODUCT_PENALTIES = tuple(10.0**power for power in range(-3, 4))


class LeastSquares(Predictor):
    """Predicts a weighted sum of functions of x, added to what the expert's model predicts where there is one.

    The weights are zero until they are fitted. Numbers are held within the range that
    the fit has seen: products that leave it would run away over the steps of a rollout.

    Args:
        units: in which the functions are computed.
        base: the expert's model, with the novice's parts alone, which stays as it is;
            None to stand alone.
        scale: weights (Y,) of the components in equation (1); all 1 by default.
    """

    loss_scale: Tensor | None

    low: Tensor  # (N,), of what the fit has seen
    high: Tensor

    def __init__(
        self,
        units: Standardisation,
        base: DynamicsModel | None = None,
        scale: Tensor | None = None,
    ):
        super().__init__()
        self.base, self.units = base, units
        inputs, self.targets = len(units.input_mean), len(units.target_mean)
        self.count = inputs + (self.targets if base is not None else 0)  # N, of numbers
        functions = 1 + self.count + self.count * (self.count + 1) // 2  # F
        self.weights = nn.Parameter(
            torch.zeros(functions, self.targets), requires_grad=False
        )
        self.register_buffer("loss_scale", scale, persistent=False)
        self.register_buffer("low", torch.full((self.count,), -torch.inf))
        self.register_buffer("high", torch.full((self.count,), torch.inf))

    def loss_weights(self, role: str) -> Tensor | None:
        """Weights (Y,) of the components in equation (1)."""
        return self.loss_scale

    def forward(
        self, role: str, inputs: Tensor, maps: Tensor, memory: Memory | None = None
    ):
        """Transitions (B, T, Y), raw units, as DynamicsModel; the memory is the base's, None without one."""
        numbers, predicted, memory = self.numbers(role, inputs, maps, memory)
        return predicted + self.functions(numbers) @ self.weights, memory

    def numbers(
        self, role: str, inputs: Tensor, maps: Tensor, memory: Memory | None = None
    ) -> tuple[Tensor, Tensor, Memory | None]:
        """What the functions are of, (B, T, N), what they are added to, (B, T, Y) in raw units, the base's memory."""
        numbers = (inputs - self.units.input_mean) / self.units.input_std
        if self.base is None:
            return numbers, inputs.new_zeros(*inputs.shape[:-1], self.targets), memory
        predicted, memory = self.base(role, inputs, maps, memory)
        standard = (predicted - self.units.target_mean) / self.units.target_std
        return torch.cat([numbers, standard], dim=-1), predicted, memory

    def functions(self, numbers: Tensor) -> Tensor:
        """What is weighted, (..., F), of numbers (..., N): a constant, themselves, products of two."""
        held = numbers.clamp(self.low, self.high)
        first, second = torch.triu_indices(self.count, self.count)
        return torch.cat(
            [
                torch.ones_like(held[..., :1]),
                held,
                held[..., first] * held[..., second],
            ],
            dim=-1,
        )

    def penalties(self, of_numbers: float, of_products: float) -> Tensor:
        """(F,) float64: how strongly each function's weights are held back; the constant's are not."""
        found = torch.full((len(self.weights),), of_products, dtype=torch.float64)
        found[0], found[1 : 1 + self.count] = 0.0, of_numbers
        return found


class Moments(NamedTuple):
    """All that least squares have to know of some steps: sums over them, float64."""

    gram: Tensor  # (F, F), of products of functions
    cross: Tensor  # (F, Y), of functions times what is to be explained
    squares: float  # of what is to be explained
    steps: int

    def plus(self, other: Moments) -> Moments:
        """Of the steps of both."""
        return Moments(*map(operator.add, self, other))

    def without(self, part: Moments) -> Moments:
        """Of the steps that are not those of a part of them."""
        return Moments(*map(operator.sub, self, part))

    def solve(self, penalties: Tensor) -> Tensor:
        """Weights (F, Y) of the lowest mean squared error with `penalties` (F,) on their squares."""
        return torch.linalg.solve(
            self.gram / self.steps + penalties.diag(), self.cross / self.steps
        )

    def loss(self, weights: Tensor) -> float:
        """Equation (1) with `weights` (F, Y), mean over the steps."""
        explained = (
            2 * (weights * self.cross).sum() - (weights * (self.gram @ weights)).sum()
        )
        return (self.squares - float(explained)) / self.steps


def moments(functions: Tensor, left: Tensor) -> Moments:
    """Those of functions (..., F) and of what they are to explain, (..., Y), both float64."""
    rows, left = functions.flatten(0, -2), left.flatten(0, -2)
    return Moments(rows.T @ rows, rows.T @ left, float(left.square().sum()), len(rows))


def fit(
    datasets: Datasets,
    units: Standardisation,
    base: DynamicsModel | None = None,
    image: Callable[[Windows], Windows] | None = None,
    scale: Tensor | None = None,
) -> Trained:
    """The weights of the lowest cross-validated loss on the novice's data, train and test together.

    Args:
        datasets: the novice's train and test split; nothing else of them is used.
        units: in which the functions are computed, the same for every method.
        base: what is corrected; none by default.
        image: gives another motion for each, to learn from too, such as its mirror
            image; none by default.
        scale: weights (Y,) of the components in equation (1); all 1 by default.

    Returns:
        The model, and how it came about: the test loss is that of the cross-validation.
    """
    model = LeastSquares(units, base, scale).eval()
    root = torch.ones(model.targets) if scale is None else scale.sqrt()
    numbers, left = _observed(model, datasets, image)
    model.low, model.high = numbers.amin((0, 1)), numbers.amax((0, 1))
    # of whole trajectories
    parts = [slice(fold, None, FOLDS) for fold in range(min(FOLDS, len(numbers)))]
    folds = [
        moments(model.functions(numbers[part].double()), (left[part] * root).double())
        for part in parts
    ]
    total = functools.reduce(Moments.plus, folds)

    def validated(penalties: Tensor) -> float:
        return (
            sum(
                fold.loss(total.without(fold).solve(penalties)) * fold.steps
                for fold in folds
            )
            / total.steps
        )

    tried = [
        model.penalties(*pair)
        for pair in itertools.product(PENALTIES, PRODUCT_PENALTIES)
    ]
    losses = [validated(penalties) for penalties in tried]
    lowest = min(losses)
    weights = total.solve(tried[losses.index(lowest)])
    model.weights.copy_(weights / root)
    curve = [Tested(total.steps, total.loss(weights), lowest, None)]
    return Trained(model, curve, total.steps, 0, lowest, total.steps, True)


def _observed(
    model: LeastSquares, datasets: Datasets, image: Callable[[Windows], Windows] | None
) -> tuple[Tensor, Tensor]:
    """Of the novice's windows: numbers (n, T, N), and what is left to explain, (n, T, Y); 2 T with an `image`."""
    numbers, left = [], []
    for part in (
        *datasets.train.split(EVALUATION_BATCH),
        *datasets.test.split(EVALUATION_BATCH),
    ):
        images = [part] if image is None else [part, image(part)]
        with torch.inference_mode():
            found = [
                (*model.numbers("novice", one.inputs, one.maps)[:2], one.targets)
                for one in images
            ]
        numbers.append(torch.cat([seen for seen, _, _ in found], dim=1))
        left.append(
            torch.cat([targets - predicted for _, predicted, targets in found], dim=1)
        )
    return torch.cat(numbers).clone(), torch.cat(left).clone()
