"""Fitting Gaussian processes with scikit-learn: kernels, then weights of samples.

A kernel has a length scale for each feature, a variance and white noise. Their values
have the highest likelihood on a part of the samples. So few samples often ask for too
short length scales, which the test split corrects by a common factor.
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

from ownrobot.methods.boosting import require_scikit_learn
from ownrobot.methods.closed_form import fitted, weights_of
from ownrobot.methods.gaussian_process import GaussianProcess, Posterior, first_guess
from ownrobot.methods.pooled import expert_windows
from ownrobot.methods.trees import features
from sidm.body import Body
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.model import Predictor
from sidm.learning.training import Trained

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


class Samples(NamedTuple):
    """What a process learns from: features (n, F) and residuals (n, Y), float64."""

    features: np.ndarray
    residuals: np.ndarray

    def at(self, rows: np.ndarray) -> Samples:
        """The samples at some rows."""
        return Samples(self.features[rows], self.residuals[rows])

    def first(self, count: int) -> Samples:
        """The first `count` samples, or all where there are fewer."""
        return Samples(self.features[:count], self.residuals[:count])

    def component(self, number: int) -> Samples:
        """The samples with residuals (n, 1) of one component."""
        return self._replace(residuals=self.residuals[:, [number]])

    def and_those(self, other: Samples) -> Samples:
        """Samples of both sets, of this set first."""
        return Samples(*map(np.concatenate, zip(self, other, strict=True)))


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
    require_scikit_learn("gp")
    further = expert_windows(datasets) if pooled else None
    with _quiet_on_one_thread():
        train, test = (
            samples(part, body, base) for part in (datasets.train, datasets.test)
        )
        more = None if further is None else samples(further, body, base)
        rng = np.random.default_rng(seed)
        drawn = _draw(train, more, rng)
        units = _moments(drawn.features)
        kernels, test_errors = fit_kernels(drawn, test, units)
        both = train.and_those(test)
        posterior = condition(_draw(both, more, rng), kernels, units)
        # Of hours of motion, these are enough for a number that only tells of the fit.
        train_errors = _errors(posterior, both.first(MOST_SAMPLES))
    model = GaussianProcess(body, posterior, base, scale)
    weights = weights_of(body, scale).double().numpy()
    train_loss, test_loss = float(train_errors @ weights), float(test_errors @ weights)
    return fitted(model, len(both.features), train_loss, test_loss)


def samples(windows: Windows, body: Body, base: Predictor | None) -> Samples:
    """Features of all steps, and what is left of their transitions."""
    rows = features(windows.inputs, windows.maps, body).flatten(0, 1)
    begun = first_guess(windows.inputs, windows.maps, body, base)
    residuals = (windows.targets.double() - begun).flatten(0, 1)
    return Samples(rows.numpy(), residuals.numpy())


def _draw(novice: Samples, expert: Samples | None, rng: np.random.Generator) -> Samples:
    """At most MOST_SAMPLES in random order."""
    most, count = MOST_SAMPLES, len(novice.features)
    if expert is None:
        return novice.at(rng.permutation(count)[:most])
    of_expert = rng.permutation(len(expert.features))[: max(most - count, most // 2)]
    of_novice = rng.permutation(count)[: most - len(of_expert)]
    both = novice.at(of_novice).and_those(expert.at(of_expert))
    return both.at(rng.permutation(len(both.features)))


def fit_kernels(
    train: Samples, test: Samples, units: FeatureUnits
) -> tuple[list[Any], np.ndarray]:
    """The kernel of each component, None of a constant one, and test errors (Y,).

    The train samples are in random order; the test samples choose the factor of the
    length scales.
    """
    kernels: list[Any] = []
    errors: list[float] = []
    for component in range(train.residuals.shape[1]):
        one, test_one = train.component(component), test.component(component)
        few, some = one.first(KERNEL_SAMPLES), one.first(FACTOR_SAMPLES)
        candidates = [None]
        if few.residuals.std() > SMALLEST_STD:
            candidates = _scaled(_most_likely_kernel(few, units))
        losses = [
            float(_errors(condition(some, [kernel], units), test_one)[0])
            for kernel in candidates
        ]
        errors.append(min(losses))
        kernels.append(candidates[losses.index(errors[-1])])
    return kernels, np.array(errors)


def _errors(posterior: Posterior, data: Samples) -> np.ndarray:
    """Mean squared errors (Y,) of the processes' means."""
    predicted = posterior.predict(torch.from_numpy(data.features)).numpy()
    return np.square(predicted - data.residuals).mean(0)


def _most_likely_kernel(data: Samples, units: FeatureUnits) -> Any:
    """scikit-learn's kernel of the highest likelihood of one component's residuals."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    mean, std = units
    lengths = np.full(len(mean), LENGTH_SCALE)
    kernel = ConstantKernel(1.0, VARIANCES) * RBF(lengths, LENGTH_SCALES)
    regressor = GaussianProcessRegressor(
        kernel + WhiteKernel(0.1, NOISES), optimizer=_climb, normalize_y=True
    )
    return regressor.fit((data.features - mean) / std, data.residuals[:, 0]).kernel_


def _scaled(kernel: Any) -> list[Any]:
    """The kernel with its length scales times each of FACTORS."""
    lengths = kernel.k1.k2.length_scale
    name = "k1__k2__length_scale"
    return [
        kernel.clone_with_theta(kernel.theta).set_params(**{name: lengths * factor})
        for factor in FACTORS
    ]


def condition(data: Samples, kernels: Sequence[Any], units: FeatureUnits) -> Posterior:
    """Means of the processes with these kernels, after n samples.

    A component of kernel None is predicted as its mean.
    """
    mean, std = units
    rows = (data.features - mean) / std
    lengths = np.ones((len(kernels), len(mean)))
    weights = np.zeros((len(rows), len(kernels)))
    baseline = data.residuals.mean(0)
    for component, kernel in enumerate(kernels):
        if kernel is None:
            continue
        lengths[component] = kernel.k1.k2.length_scale
        covariance = kernel(rows)
        covariance[np.diag_indices_from(covariance)] += JITTER
        factor = cho_factor(covariance, lower=True, overwrite_a=True)
        solved = cho_solve(factor, data.residuals[:, component] - baseline[component])
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
