"""Gaussian processes: one regression for each component of y, with all its samples.

The mean of a process is a weighted sum of kernels, one at each sample that was learnt
from. A kernel has a length scale for each feature, a variance and white noise, of the
highest likelihood on a part of the samples. So few samples often ask for too short
length scales, which the test split corrects by a common factor.

Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), equation 2.25.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from scipy.linalg import cho_factor, cho_solve
from torch import Tensor

from ownrobot.methods.closed_form import fitted, weights_of
from ownrobot.methods.fine_tuning import expert_of
from ownrobot.methods.regression import Regression, Samples, joined, samples
from sidm.body import Body
from sidm.learning.dataset import Datasets
from sidm.learning.model import Predictor
from sidm.learning.training import Trained

ROWS_AT_A_TIME = 512  # each meets every sample: this limits the memory
#: Samples that a process learns from, at most: time grows with the third power.
MOST_SAMPLES = 3_000
#: Samples that find the kernel, and those that choose the factor of its length scales.
KERNEL_SAMPLES, FACTOR_SAMPLES = 400, 800
KERNEL_ITERATIONS = 12  # of L-BFGS-B, at most
FACTORS = (1.0, 2.0, 4.0)
#: First length scale, and the range of all, in standard deviations of a feature.
LENGTH_SCALE, LENGTH_SCALES = 3.0, (0.3, 1e3)
#: Ranges of a kernel's variance and noise, in variances of a component.
VARIANCES, NOISES = (1e-3, 1e4), (1e-5, 2.0)
JITTER = 1e-10  # is added to the diagonal of a covariance, as scikit-learn does
#: Standard deviation below which a component or a feature counts as constant.
SMALLEST_STD = 1e-9

#: Mean and standard deviation (F,) of the features.
FeatureUnits = tuple[np.ndarray, np.ndarray]


class Posterior(NamedTuple):
    """Means of several processes that have learnt from the same samples; all float64.

    The kernel of a component is exp(-d^2 / 2), d in length scales.
    """

    mean: Tensor  # (F,), is subtracted from features
    std: Tensor  # (F,), divides features
    samples: Tensor  # (n, F), standardised features that were learnt from
    length_scales: Tensor  # (Y, F), in units of `std`
    weights: Tensor  # (n, Y), of the kernels at the samples
    baseline: Tensor  # (Y,), the components far away from all samples

    def predict(self, rows: Tensor) -> Tensor:
        """Components (N, Y), float64, at features (N, F), float64."""
        parts = [self._predict_part(part) for part in rows.split(ROWS_AT_A_TIME)]
        return torch.cat(parts) if parts else self.baseline.expand(0, -1)

    def _predict_part(self, rows: Tensor) -> Tensor:
        rows = (rows - self.mean) / self.std
        predicted = [
            _kernel(rows / scales, self.samples / scales) @ weights
            for scales, weights in zip(self.length_scales, self.weights.T, strict=True)
        ]
        return self.baseline + torch.stack(predicted, 1)


def _kernel(rows: Tensor, samples: Tensor) -> Tensor:
    """exp(-d^2 / 2), (N, n), of distances between rows (N, F) and samples (n, F)."""
    squares = rows.square().sum(1)[:, None] + samples.square().sum(1)
    return (
        torch.addmm(squares, rows, samples.T, alpha=-2).clamp_min_(0).mul_(-0.5).exp_()
    )


def learn(
    datasets: Datasets,
    body: Body,
    scale: Tensor | None = None,
    base: Predictor | None = None,
    pooled: bool = False,
    seed: int = 0,
) -> Trained:
    """Fit the Gaussian processes of a novice.

    They are exact up to 3,000 samples; of more, a random 3,000 are learnt from. The
    kernels come from 400 of these. Train and test split are learnt from together; the
    test loss is that of processes of at most 800 samples of the train split. They
    correct the `base`, a model without a memory. If `pooled`, the expert's samples are
    learnt from too, as half of all or more where there are few of the novice.
    """
    with _quiet_on_one_thread():
        train, test = (
            samples(part, body, base) for part in (datasets.train, datasets.test)
        )
        expert = samples(expert_of(datasets), body, base) if pooled else None
        rng = np.random.default_rng(seed)
        drawn = _draw(train, expert, rng)
        units = _moments(drawn[0])
        kernels, test_errors = _fit_kernels(drawn, test, units)
        both = joined(train, test)
        posterior = condition(_draw(both, expert, rng), kernels, units)
        # Of hours of motion, these are enough for a number that only tells of the fit.
        rows, residuals = (part[:MOST_SAMPLES] for part in both)
        train_errors = _errors(posterior, rows, residuals)
    model = Regression(body, posterior, base, scale)
    weights = weights_of(body, scale).double().numpy()
    train_loss, test_loss = float(train_errors @ weights), float(test_errors @ weights)
    return fitted(model, len(both[0]), train_loss, test_loss)


def _draw(novice: Samples, expert: Samples | None, rng: np.random.Generator) -> Samples:
    """At most MOST_SAMPLES in random order."""
    most, count = MOST_SAMPLES, len(novice[0])
    if expert is None:
        rows = rng.permutation(count)[:most]
        return novice[0][rows], novice[1][rows]
    of_expert = rng.permutation(len(expert[0]))[: max(most - count, most // 2)]
    of_novice = rng.permutation(count)[: most - len(of_expert)]
    x, y = joined(
        (novice[0][of_novice], novice[1][of_novice]),
        (expert[0][of_expert], expert[1][of_expert]),
    )
    order = rng.permutation(len(x))
    return x[order], y[order]


def _fit_kernels(
    train: Samples, test: Samples, units: FeatureUnits
) -> tuple[list[Any], np.ndarray]:
    """The kernel of each component, None of a constant one, and test errors (Y,).

    The train samples are in random order; the test samples choose the factor of the
    length scales.
    """
    kernels: list[Any] = []
    errors: list[float] = []
    x, some = train[0], train[0][:FACTOR_SAMPLES]
    for component in range(train[1].shape[1]):
        y, y_test = (part[1][:, [component]] for part in (train, test))
        few = y[:KERNEL_SAMPLES]
        candidates = [None]
        if few.std() > SMALLEST_STD:
            candidates = _candidates(x[:KERNEL_SAMPLES], few[:, 0], units)
        losses = []
        for kernel in candidates:
            posterior = condition((some, y[:FACTOR_SAMPLES]), [kernel], units)
            losses.append(float(_errors(posterior, test[0], y_test)[0]))
        errors.append(min(losses))
        kernels.append(candidates[losses.index(errors[-1])])
    return kernels, np.array(errors)


def _errors(posterior: Posterior, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Mean squared errors (Y,) of the processes' means."""
    return np.square(posterior.predict(torch.from_numpy(x)).numpy() - y).mean(0)


def _candidates(x: np.ndarray, y: np.ndarray, units: FeatureUnits) -> list[Any]:
    """scikit-learn's kernel of y's highest likelihood, its lengths times FACTORS."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    mean, std = units
    lengths = np.full(len(mean), LENGTH_SCALE)
    kernel = ConstantKernel(1.0, VARIANCES) * RBF(lengths, LENGTH_SCALES)
    regressor = GaussianProcessRegressor(
        kernel + WhiteKernel(0.1, NOISES), optimizer=_climb, normalize_y=True
    )
    found = regressor.fit((x - mean) / std, y).kernel_
    name, lengths = "k1__k2__length_scale", found.k1.k2.length_scale
    return [
        found.clone_with_theta(found.theta).set_params(**{name: lengths * factor})
        for factor in FACTORS
    ]


def condition(data: Samples, kernels: Sequence[Any], units: FeatureUnits) -> Posterior:
    """Means of the processes with these kernels, after n samples.

    A component of kernel None is predicted as its mean.
    """
    (mean, std), (x, y) = units, data
    rows = (x - mean) / std
    lengths = np.ones((len(kernels), len(mean)))
    weights = np.zeros((len(rows), len(kernels)))
    baseline = y.mean(0)
    for component, kernel in enumerate(kernels):
        if kernel is None:
            continue
        lengths[component] = kernel.k1.k2.length_scale
        covariance = kernel(rows)
        covariance[np.diag_indices_from(covariance)] += JITTER
        factor = cho_factor(covariance, lower=True, overwrite_a=True)
        solved = cho_solve(factor, y[:, component] - baseline[component])
        weights[:, component] = kernel.k1.k1.constant_value * solved
    arrays = mean, std, rows, lengths, weights, baseline
    return Posterior(*(torch.from_numpy(array) for array in arrays))


def _moments(rows: np.ndarray) -> FeatureUnits:
    """Mean and standard deviation (F,) of features; 1 for a constant feature."""
    std = rows.std(0)
    return rows.mean(0), np.where(std > SMALLEST_STD, std, 1.0)


def _climb(
    negative_likelihood: Callable[[np.ndarray], tuple[float, np.ndarray]],
    start: np.ndarray,
    bounds: np.ndarray,
) -> tuple[np.ndarray, float]:
    """scikit-learn's optimiser, but with KERNEL_ITERATIONS at most."""
    from scipy.optimize import minimize

    options = {"maxiter": KERNEL_ITERATIONS}
    how = {"method": "L-BFGS-B", "jac": True, "bounds": bounds, "options": options}
    found = minimize(negative_likelihood, start, **how)
    return found.x, found.fun


@contextlib.contextmanager
def _quiet_on_one_thread() -> Iterator[None]:
    """A length scale at its bound is no fault, and one thread gives the same bits."""
    from sklearn.exceptions import ConvergenceWarning
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        yield
