"""A novice's model by least squares: a weighted sum of a few functions of x.

The sum is the whole transition, or the error of the expert's model. The functions are a
constant, the 11 numbers of x, the 13 of the expert's prediction if there is one, and
all products of two of these. Their weights have a closed form, so a novice is learnt in
seconds. Two penalties on the weights (ridge regression), one for the numbers and one
for their products, are chosen by cross-validation.
"""

from __future__ import annotations

import functools
import itertools
import operator
from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn

from ownrobot.methods.closed_form import ClosedForm, fitted
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.evaluation import EVALUATION_BATCH
from sidm.learning.model import Predictor
from sidm.learning.networks import Memory
from sidm.learning.training import Trained
from sidm.learning.units import Standardisation, divisor

FOLDS = 5  # folds of the cross-validation, at most
#: Penalties on the weights of the numbers themselves.
PENALTIES = tuple(10.0**power for power in range(-4, 1))
#: Penalties on the weights of the numbers' products.
PRODUCT_PENALTIES = tuple(10.0**power for power in range(-3, 4))

Image = Callable[[Windows], Windows]  # other motion of the robot, from windows


class LeastSquares(ClosedForm):
    """Predicts a weighted sum of functions, added to the prediction of a base if any.

    The base is the expert's model, which is not changed: a network with the novice's
    parts alone, or least squares. The functions are computed in `units`. The weights
    are zero until they are fitted. Every number is limited to the range of the data
    that the model was fitted to: products of numbers outside of it would diverge over
    the steps of a rollout.
    """

    low: Tensor  # (N,), smallest numbers in the data
    high: Tensor  # (N,), largest numbers in the data

    def __init__(
        self,
        units: Standardisation,
        base: Predictor | None = None,
        scale: Tensor | None = None,
    ):
        super().__init__(scale)
        self.base, self.units = base, units
        inputs, self.targets = len(units.input_mean), len(units.target_mean)
        self.count = inputs + (self.targets if base is not None else 0)  # N
        functions = 1 + self.count + self.count * (self.count + 1) // 2  # F
        zeros = torch.zeros(functions, self.targets)
        self.weights = nn.Parameter(zeros, requires_grad=False)
        self.register_buffer("low", torch.full((self.count,), -torch.inf))
        self.register_buffer("high", torch.full((self.count,), torch.inf))

    def forward(
        self, role: str, inputs: Tensor, maps: Tensor, memory: Memory | None = None
    ):
        """Transitions (B, T, Y) in raw units, and the base's memory."""
        numbers, predicted, memory = self.numbers(role, inputs, maps, memory)
        return predicted + self.functions(numbers) @ self.weights, memory

    def numbers(
        self, role: str, inputs: Tensor, maps: Tensor, memory: Memory | None = None
    ) -> tuple[Tensor, Tensor, Memory | None]:
        """Numbers (B, T, N) that the functions see, and what their sum is added to.

        That is the base's transitions (B, T, Y) in raw units, 0 without a base; the
        base's memory comes last.
        """
        numbers = (inputs - self.units.input_mean) / self.units.input_std
        if self.base is None:
            return numbers, inputs.new_zeros(*inputs.shape[:-1], self.targets), memory
        predicted, memory = self.base(role, inputs, maps, memory)
        deviations = predicted - self.units.target_mean
        standard = deviations / divisor(self.units.target_std)
        return torch.cat([numbers, standard], dim=-1), predicted, memory

    def functions(self, numbers: Tensor) -> Tensor:
        """Functions (..., F) of numbers (..., N): 1, the numbers, products of two."""
        held = numbers.clamp(self.low, self.high)
        first, second = torch.triu_indices(self.count, self.count)
        products = held[..., first] * held[..., second]
        return torch.cat([torch.ones_like(held[..., :1]), held, products], dim=-1)

    def penalties(self, of_numbers: float, of_products: float) -> Tensor:
        """Penalties (F,), float64, on the weights; that of the constant is 0."""
        penalties = torch.full((len(self.weights),), of_products, dtype=torch.float64)
        penalties[0], penalties[1 : 1 + self.count] = 0.0, of_numbers
        return penalties


class NormalEquations(NamedTuple):
    """Sums over some steps, float64, from which least squares are solved."""

    gram: Tensor  # (F, F), products of two functions
    cross: Tensor  # (F, Y), products of a function and a target
    squares: float  # of the targets
    steps: int  # how many were added

    def plus(self, other: NormalEquations) -> NormalEquations:
        """Sums over these steps and those of `other`."""
        return NormalEquations(*map(operator.add, self, other))

    def without(self, part: NormalEquations) -> NormalEquations:
        """Sums over these steps except those of `part`."""
        return NormalEquations(*map(operator.sub, self, part))

    def solve(self, penalties: Tensor) -> Tensor:
        """Weights (F, Y) of the lowest mean squared error with penalties (F,)."""
        gram = self.gram / self.steps + penalties.diag()
        return torch.linalg.solve(gram, self.cross / self.steps)

    def loss(self, weights: Tensor) -> float:
        """Equation (1) with `weights` (F, Y), mean over the steps."""
        quadratic = (weights * (self.gram @ weights)).sum()
        explained = 2 * (weights * self.cross).sum() - quadratic
        return (self.squares - float(explained)) / self.steps


def normal_equations(functions: Tensor, targets: Tensor) -> NormalEquations:
    """Sums over the steps of functions (..., F) and targets (..., Y), both float64."""
    rows, targets = functions.flatten(0, -2), targets.flatten(0, -2)
    squares = float(targets.square().sum())
    return NormalEquations(rows.T @ rows, rows.T @ targets, squares, len(rows))


def fit(
    datasets: Datasets,
    units: Standardisation,
    base: Predictor | None = None,
    image: Image | None = None,
    scale: Tensor | None = None,
    further: Windows | None = None,
) -> Trained:
    """Fit the weights of a `LeastSquares` model to the novice's train and test split.

    The penalties are those of the lowest cross-validated loss, which is the test loss.
    Other motion of the robot, such as its mirror `image`, is learnt from too. `scale`
    has the weights (Y,) of the components in equation (1), 1 by default. `further`
    windows of another robot are learnt from in every fold, but do not count in the
    loss.
    """
    model = LeastSquares(units, base, scale).eval()
    root = torch.ones(model.targets)
    if scale is not None:  # a component of weight 0 is fitted all the same
        root = torch.where(scale > 0, scale.sqrt(), root)
    numbers, residuals = _numbers_and_residuals(model, datasets[:2], image)
    others = numbers[:0], residuals[:0]
    if further is not None:
        others = _numbers_and_residuals(model, (further,), image)
    every = torch.cat([numbers, others[0]])  # windows of both have one length
    model.low, model.high = every.amin((0, 1)), every.amax((0, 1))

    def sums(numbers: Tensor, residuals: Tensor) -> NormalEquations:
        functions = model.functions(numbers.double())
        return normal_equations(functions, (residuals * root).double())

    folds = [  # each of whole trajectories
        sums(numbers[fold::FOLDS], residuals[fold::FOLDS])
        for fold in range(min(FOLDS, len(numbers)))
    ]
    total = functools.reduce(NormalEquations.plus, folds)
    if further is not None:
        total = total.plus(sums(*others))

    def validation_loss(penalties: Tensor) -> float:
        losses = [fold.loss(total.without(fold).solve(penalties)) for fold in folds]
        steps = [fold.steps for fold in folds]
        return sum(map(operator.mul, losses, steps)) / sum(steps)

    grid = itertools.product(PENALTIES, PRODUCT_PENALTIES)
    candidates = [model.penalties(*penalties) for penalties in grid]
    losses = [validation_loss(penalties) for penalties in candidates]
    lowest = min(losses)
    weights = total.solve(candidates[losses.index(lowest)])
    model.weights.copy_(weights / root)
    return fitted(model, total.steps, total.loss(weights), lowest)


def _numbers_and_residuals(
    model: LeastSquares, sets: Sequence[Windows], image: Image | None
) -> tuple[Tensor, Tensor]:
    """Numbers (n, T, N), and what the base leaves of the transitions, (n, T, Y).

    With an `image` there are 2 T in place of T steps.
    """
    rows = []
    for windows in sets:
        for part in windows.split(EVALUATION_BATCH):
            pairs = []
            for one in [part] if image is None else [part, image(part)]:
                with torch.inference_mode():
                    numbers, base, _ = model.numbers("novice", one.inputs, one.maps)
                pairs.append((numbers, one.targets - base))
            rows.append([torch.cat(each, dim=1) for each in zip(*pairs, strict=True)])
    numbers, residuals = (torch.cat(parts) for parts in zip(*rows, strict=True))
    return numbers.clone(), residuals.clone()
