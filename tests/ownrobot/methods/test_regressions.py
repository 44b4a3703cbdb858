"""Least squares, boosted trees and Gaussian processes, of one robot or of two."""

import importlib.util

import numpy as np
import pytest
import torch
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from ownrobot.fitting.learning import SETTINGS, learn, network_for, refuse_method
from ownrobot.methods import gaussian_process, least_squares
from ownrobot.methods.boosting import Forest
from ownrobot.methods.closed_form import learn_trivial
from ownrobot.methods.gaussian_process import condition
from ownrobot.methods.registry import METHODS
from ownrobot.methods.regression import map_features
from sidm.body import ROVER, Body
from sidm.config import ConfigError, replace
from sidm.learning import Datasets, Standardisation, validation_loss
from sidm.learning.dataset import Windows
from sidm.learning.evaluation import mean_loss, rollout
from tests.ownrobot.cart import CART as PLAIN_CART

CART = replace(PLAIN_CART, actions=(("throttle", "1"), ("steering", "1")))
POOLED = [name for name, method in METHODS.items() if method.pooled]
CORRECTED = ["least_squares_corrected", "trees_corrected", "gp_corrected"]
BENT = pytest.mark.parametrize("method", ["trees", "gp"])


def motion(
    rng, windows: int, gain: float = 1.0, steps: int = 10, bent: bool = True
) -> Windows:
    """A cart whose speed follows its throttle, or a sine of it, with noise."""
    throttle, steering = np.moveaxis(rng.uniform(-1, 1, (windows, steps, 2)), 2, 0)
    push = np.sin(3 * throttle) if bent else throttle * (1 + 0.3 * steering)
    speeds = np.zeros((windows, steps + 1))
    for step in range(steps):
        speeds[:, step + 1] = 0.7 * speeds[:, step] + gain * push[:, step]
    before, after = speeds[:, :-1], speeds[:, 1:]
    turn = 0.1 * (np.cos(3 * steering) if bent else steering) * after
    targets = np.stack([0.1 * after, 0 * turn, turn, after], -1)
    noise = [0.01, 0, 0.01, 0.01] if bent else 0.05 * targets.std((0, 1))
    targets += rng.normal(size=targets.shape) * noise
    inputs = np.stack([before, throttle, steering], -1)
    x, y = (torch.from_numpy(part).float() for part in (inputs, targets))
    return Windows(x, y, torch.zeros(windows, steps, 0, 0))


@pytest.fixture(autouse=True)
def few_samples(monkeypatch):
    """A smooth law without much noise needs few for its kernels."""
    monkeypatch.setattr(gaussian_process, "KERNEL_SAMPLES", 150)


@pytest.fixture
def carts(rng) -> Datasets:
    return Datasets(*(motion(rng, windows) for windows in (60, 20, 20)))


@pytest.fixture
def pair(rng) -> Datasets:
    """A twentieth of the expert's motion of a novice that is weaker by a fifth."""
    parts = (motion(rng, windows, 0.8, 6, False) for windows in (3, 1, 40))
    return Datasets(*parts, motion(rng, 80, 1.0, 6, False))


def learnt(method: str, sets: Datasets, body: Body = CART, seed: int = 1):
    return learn(method, sets, network_for(SETTINGS, body, body), seed)


def test_trees_as_tensors_predict_what_scikit_learn_predicts(rng):
    """Missing numbers go where scikit-learn sends them."""
    x = rng.normal(size=(400, 3))
    x[rng.uniform(size=x.shape) < 0.1] = np.nan
    y = np.nan_to_num(np.sign(x[:, 0]) + x[:, 1] ** 2) + 5.0
    forest = Forest.constant(torch.tensor([0.0, 7.0]))
    regressor = HistGradientBoostingRegressor(max_iter=40, min_samples_leaf=5).fit(x, y)
    nodes = [predictors[0].nodes for predictors in regressor._predictors]
    forest = forest.with_trees(0, nodes, float(regressor._baseline_prediction.item()))
    fresh = np.vstack([rng.normal(size=(600, 3)), [[np.nan] * 3, [1e9, -1e9, 0.0]]])
    predicted = forest.predict(torch.from_numpy(fresh))
    assert np.allclose(predicted[:, 0], regressor.predict(fresh), rtol=1e-12)
    assert (predicted[:, 1] == 7.0).all()


def test_processes_as_tensors_predict_what_scikit_learn_predicts(rng):
    x, y = rng.normal(5, 2, (60, 3)), rng.normal(3, 2, (60, 3))
    y[:, 2] = 7.0
    lengths = ([1.0, 2.0, 5.0], [0.5, 9.0, 3.0])
    kernels = [
        ConstantKernel(c) * RBF(length) + WhiteKernel(0.1)
        for c, length in zip((2.0, 0.5), lengths, strict=True)
    ]
    mean, std = x.mean(0), x.std(0)
    posterior = condition((x, y), [*kernels, None], (mean, std))
    fresh = np.vstack([rng.normal(5, 2, (600, 3)), [[1e9, -1e9, 0.0]]])
    predicted = posterior.predict(torch.from_numpy(fresh))
    for component, kernel in enumerate(kernels):
        regressor = GaussianProcessRegressor(kernel, optimizer=None, normalize_y=True)
        regressor.fit((x - mean) / std, y[:, component])
        expected = regressor.predict((fresh - mean) / std)
        assert np.allclose(predicted[:, component], expected, rtol=1e-9, atol=1e-9)
    assert (predicted[:, 2] == 7.0).all()
    assert np.allclose(predicted[-1], y.mean(0))  # far away from all samples


@BENT
def test_a_curve_is_learnt_better_than_by_least_squares_and_driven(carts, method):
    trained = learnt(method, carts)
    squares = learnt("least_squares", carts)
    losses = [mean_loss(some.model, carts.validation) for some in (trained, squares)]
    assert losses[0] < 0.2 * losses[1]
    assert losses[0] == pytest.approx(trained.best_test_loss, rel=0.5)
    predicted, _ = trained.model("novice", carts.test.inputs, carts.test.maps)
    assert (predicted[..., 1] == 0).all()  # what never varies is its mean
    actions = torch.tensor([[0.5, 0.0]]).expand(2, -1)
    path = rollout(trained.model, None, torch.zeros(4), actions, 0, body=CART)
    assert float(path[-1, 3]) == pytest.approx(1.7 * np.sin(1.5), rel=0.05)


@BENT
def test_the_memory_is_the_x_before(carts, method):
    model = learnt(method, carts).model
    inputs, maps = carts.test.inputs, carts.test.maps
    whole, _ = model("novice", inputs, maps)
    memory, steps = None, []
    for now in torch.arange(inputs.shape[1]).split(5):
        predicted, memory = model("novice", inputs[:, now], maps[:, now], memory)
        steps.append(predicted)
    assert torch.allclose(torch.cat(steps, 1), whole, atol=1e-6)


@BENT
def test_regressions_see_the_ground(rng, method):
    body = replace(CART, map_size=5.0, map_pixels=8)
    slope = torch.from_numpy(rng.uniform(-0.3, 0.3, (40, 10))).float()
    places = ((torch.arange(8) + 0.5) / 8 - 0.5) * 5.0
    maps = (slope[..., None, None] * places).expand(-1, -1, 8, 8).half()
    targets = torch.zeros(40, 10, 4)
    targets[..., 0] = -slope
    windows = Windows(torch.zeros(40, 10, 3), targets, maps)
    sets = Datasets(windows.first(30), windows.subset(range(30, 40)), windows)
    seeing, blind = (learnt(method, sets, of).best_test_loss for of in (body, CART))
    assert seeing < 0.01 * blind


def test_the_map_in_numbers():
    places = ((torch.arange(32) + 0.5) / 32 - 0.5) * 5.0
    y, x = torch.meshgrid(places, places, indexing="ij")
    surface = 0.3 + 0.2 * x - 0.1 * y + 0.5 * (x**2 + y**2) / 2
    found = map_features(surface[None], 5.0)[0]
    bend = 0.5 / 24  # the mean of (x^2 + y^2) / 4 over a metre's square
    for number, value, near in (
        (0, 0.3, 1e-4),
        (1, 0.2, 1e-4),
        (2, -0.1, 1e-4),
        (3, 0.5, 1e-4),
        (8, 0.3 + 2 * bend, 0.01),  # the cell of the robot, ahead, to the left
        (9, 0.3 + 0.2 + 0.25 + 2 * bend, 0.03),
        (11, 0.3 - 0.1 + 0.25 + 2 * bend, 0.03),
    ):
        assert float(found[number]) == pytest.approx(value, abs=near), number
    for pixels in (1, 2, 3):
        coarse = map_features(torch.full((2, 3, pixels, pixels), 0.5).half(), 5.0)
        assert torch.allclose(coarse[..., 4:], torch.tensor(0.5))


@pytest.mark.parametrize("method", [*POOLED, *CORRECTED])
def test_the_expert_helps_with_little_data_and_the_seed_decides(pair, method):
    alone = method.removesuffix("_pooled").removesuffix("_corrected")
    first, again, without = (
        learnt(name, pair).model for name in (method, method, alone)
    )
    losses = [mean_loss(model, pair.validation) for model in (first, without)]
    assert losses[0] < 0.8 * losses[1]
    inputs, maps = pair.validation.inputs, pair.validation.maps
    assert torch.equal(*(model("novice", inputs, maps)[0] for model in (first, again)))


def test_another_robots_windows_count_in_no_fold(pair):
    """Penalties are chosen for the novice: the loss is that of its steps alone."""
    units = Standardisation.fit(pair.train)
    fitted = least_squares.fit(pair, units, further=pair.expert)
    shuffled = replace(pair.expert, stored_targets=100 + pair.expert.targets)
    spoilt = least_squares.fit(pair, units, further=shuffled)
    assert fitted.best_test_loss < 0.05 < 1e3 < spoilt.best_test_loss


def test_what_needs_an_expert_of_one_body_or_a_library_is_one_line(monkeypatch):
    other = replace(CART, columns=(("speed", "m/s"), ("yaw_rate", "rad/s")))
    for method, expert, words in (
        ("trees_corrected", None, "learns from an expert's drives too.*take trees$"),
        ("corrected", None, "pass them, or take novice_only$"),
        ("gp_corrected", other, "needs robots of one body; take gp$"),
        ("trees_pooled", other, "trees of both robots.*one body; take trees$"),
    ):
        with pytest.raises(ConfigError, match=words):
            refuse_method(method, CART, expert)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r'pip install "sidm\[trees\]"'):
        refuse_method("gp", CART, None)


@pytest.fixture
def many(make_motion) -> Datasets:
    return Datasets(make_motion(30, 1), make_motion(10, 2), make_motion(8, 3))


def test_the_weights_and_the_loss_are_those_of_ridge_regression(rng):
    """NumPy's least squares with a row more for each penalty gives the same weights."""
    rows, left = rng.normal(size=(50, 4)), rng.normal(size=(50, 13))
    penalties = np.array([0.0, 0.1, 0.1, 2.0])
    made = least_squares.normal_equations(
        torch.from_numpy(rows), torch.from_numpy(left)
    )
    weights = made.solve(torch.from_numpy(penalties))
    more = (
        np.vstack([rows, np.diag(np.sqrt(50 * penalties))]),
        np.vstack([left, np.zeros((4, 13))]),
    )
    expected = np.linalg.lstsq(*more, rcond=None)[0]
    assert np.allclose(weights.numpy(), expected, atol=1e-10)
    loss = np.square(left - rows @ expected).sum(1).mean()
    assert made.loss(weights) == pytest.approx(loss)


def test_a_linear_law_is_found(many):
    """The rest of the loss is the maps' part, which the method does not use."""
    units = Standardisation.none()
    fitted = least_squares.fit(many, units)
    loss = validation_loss(fitted.model, many.validation)
    spread = many.validation.targets.var((0, 1))
    assert float(loss.sum()) < 0.01 * float(spread.sum())
    assert fitted.best_test_loss == pytest.approx(float(loss.sum()), rel=0.5)
    far, edge = torch.full((1, 1, 11), 1e9), fitted.model.high[None, None]
    maps = many.train.maps[:1, :1]  # what was never seen is held at the edge
    assert torch.equal(*(fitted.model("novice", x, maps)[0] for x in (far, edge)))


def test_the_cross_validated_loss_is_of_steps_that_were_not_seen(many, monkeypatch):
    """Each fold is tested by hand; penalties that drown the law are not taken."""
    monkeypatch.setattr(least_squares, "PENALTIES", (1e6, 0.1))
    monkeypatch.setattr(least_squares, "PRODUCT_PENALTIES", (10.0,))
    fitted = least_squares.fit(many, Standardisation.none())
    inputs, targets = (
        torch.cat([getattr(windows, name) for windows in many[:2]]).double()
        for name in ("inputs", "targets")
    )
    functions, total = fitted.model.functions(inputs), 0.0
    for fold in range(least_squares.FOLDS):
        out = torch.arange(len(inputs)) % least_squares.FOLDS == fold
        weights = least_squares.normal_equations(functions[~out], targets[~out]).solve(
            fitted.model.penalties(0.1, 10.0)
        )
        total += float((targets[out] - functions[out] @ weights).square().sum())
    assert fitted.best_test_loss == pytest.approx(total / (40 * 6))


def test_yardsticks_predict_no_change_and_the_mean_of_the_training_data(datasets):
    still = learn_trivial(datasets, ROVER, "nothing_changes").model
    state = torch.tensor([1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8, *range(6)]).double()
    path = rollout(still, torch.zeros(9, 9), state, torch.ones(5, 2), 8)
    assert torch.allclose(path, state.expand(6, -1))
    trained = learn_trivial(datasets, ROVER, "mean", torch.ones(13))
    targets, mean = datasets.test.targets, datasets.train.targets.mean((0, 1))
    assert torch.allclose(trained.model("novice", targets, None)[0], mean)
    loss = (targets - mean).square().sum(-1).mean()
    assert trained.best_test_loss == pytest.approx(float(loss))
