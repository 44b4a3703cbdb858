"""Gaussian processes: as tensors they predict like scikit-learn's, and learn curves."""

import numpy as np
import pytest
import torch
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from ownrobot.fitting.learning import refuse_method
from ownrobot.methods import boosting, gaussian_fitting, least_squares
from ownrobot.methods.gaussian_fitting import Samples, condition, learn
from ownrobot.methods.gaussian_process import GaussianProcess, Posterior
from ownrobot.methods.least_squares import LeastSquares
from sidm.body import Body
from sidm.config import ConfigError, replace
from sidm.learning import Datasets, Standardisation
from sidm.learning.dataset import Windows
from sidm.learning.evaluation import mean_loss, rollout

CART = Body(
    name="cart",
    pose="planar",
    columns=(("speed", "m/s"),),
    actions=(("throttle", "1"), ("steering", "1")),
)


def motion(rng, windows: int, gain: float = 1.0, steps: int = 10) -> Windows:
    """A cart whose speed follows a sine of its throttle, with noise."""
    throttle, steering = np.moveaxis(rng.uniform(-1, 1, (windows, steps, 2)), 2, 0)
    speeds = np.zeros((windows, steps + 1))
    for step in range(steps):
        push = gain * np.sin(3 * throttle[:, step])
        speeds[:, step + 1] = 0.7 * speeds[:, step] + push
    before, after = speeds[:, :-1], speeds[:, 1:]
    turn = 0.1 * np.cos(3 * steering) * after
    targets = [0.1 * after, 0 * turn, turn, after]
    x, y = (
        torch.from_numpy(np.stack(part, -1)).float()
        for part in ([before, throttle, steering], targets)
    )
    noise = 0.01 * torch.from_numpy(rng.normal(size=y.shape)).float()
    y = y + noise * torch.tensor([1.0, 0.0, 1.0, 1.0])
    return Windows(x, y, torch.zeros(windows, steps, 0, 0))


@pytest.fixture(autouse=True)
def few_samples(monkeypatch):
    """A smooth law without much noise needs few for its kernels."""
    monkeypatch.setattr(gaussian_fitting, "KERNEL_SAMPLES", 150)


@pytest.fixture
def carts(rng) -> Datasets:
    return Datasets(
        motion(rng, 30), motion(rng, 10), motion(rng, 20), motion(rng, 40, gain=0.8)
    )


def scale_of(sets: Datasets) -> torch.Tensor:
    """Weights of the components; the second is constant and has none."""
    variance = sets.train.targets.var((0, 1))
    return torch.where(variance > 0, 1 / variance, 0.0)


def of_expert(sets: Datasets) -> LeastSquares:
    """The expert's least squares."""
    expert = sets._replace(train=sets.expert, test=sets.expert)
    return least_squares.fit(expert, Standardisation.fit(sets.train)).model


def test_tensors_predict_what_scikit_learn_predicts(rng):
    x, y = rng.normal(5, 2, (60, 3)), rng.normal(3, 2, (60, 3))
    y[:, 2] = 7.0
    lengths = ([1.0, 2.0, 5.0], [0.5, 9.0, 3.0])
    kernels = [
        ConstantKernel(c) * RBF(length) + WhiteKernel(0.1)
        for c, length in zip((2.0, 0.5), lengths, strict=True)
    ]
    mean, std = x.mean(0), x.std(0)
    posterior = condition(Samples(x, y), [*kernels, None], (mean, std))
    fresh = np.vstack([rng.normal(5, 2, (600, 3)), [[1e9, -1e9, 0.0]]])
    predicted = posterior.predict(torch.from_numpy(fresh))
    for component, kernel in enumerate(kernels):
        regressor = GaussianProcessRegressor(kernel, optimizer=None, normalize_y=True)
        regressor.fit((x - mean) / std, y[:, component])
        expected = regressor.predict((fresh - mean) / std)
        assert np.allclose(predicted[:, component], expected, rtol=1e-9, atol=1e-9)
    assert (predicted[:, 2] == 7.0).all()
    assert np.allclose(predicted[-1], y.mean(0))  # far away from all samples


def test_a_curve_is_learnt_better_than_by_least_squares(carts):
    scale = scale_of(carts)
    trained = learn(carts, CART, scale)
    units = Standardisation.fit(carts.train)
    squares = least_squares.fit(carts, units, scale=scale)
    losses = [mean_loss(some.model, carts.validation) for some in (trained, squares)]
    assert losses[0] < 0.2 * losses[1]
    assert losses[0] == pytest.approx(trained.best_test_loss, rel=0.5)
    predicted, _ = trained.model("novice", carts.test.inputs, carts.test.maps)
    assert (predicted[..., 1] == 0).all()  # what never varies is its mean


def test_the_same_seed_draws_the_same_samples(carts, monkeypatch):
    monkeypatch.setattr(gaussian_fitting, "MOST_SAMPLES", 80)
    first, second, third = (
        learn(carts, CART, seed=seed).model.state_dict() for seed in (3, 3, 4)
    )
    assert all(torch.equal(tensor, second[name]) for name, tensor in first.items())
    assert first["samples"].shape == (80, 6)
    assert not torch.equal(first["samples"], third["samples"])


def test_the_memory_is_the_x_before(carts):
    """Step by step, with the memory, the model predicts what it predicts at once."""
    model = learn(carts, CART, base=of_expert(carts)).model
    inputs, maps = carts.test.inputs, carts.test.maps
    whole, _ = model("novice", inputs, maps)
    memory, steps = None, []
    for step in range(inputs.shape[1]):
        now = slice(step, step + 1)
        predicted, memory = model("novice", inputs[:, now], maps[:, now], memory)
        steps.append(predicted)
    assert torch.allclose(torch.cat(steps, 1), whole, atol=1e-6)


def test_processes_drive(carts):
    model = learn(carts, CART).model
    actions = torch.tensor([[0.5, 0.0]]).expand(40, -1)
    path = rollout(model, None, torch.zeros(4), actions, 0, body=CART)
    speed = np.sin(1.5) / 0.3  # the law's
    assert float(path[-1, 3]) == pytest.approx(speed, rel=0.1)


def test_a_correction_is_better_than_what_it_corrects(carts):
    scale, base = scale_of(carts), of_expert(carts)
    before = {name: tensor.clone() for name, tensor in base.state_dict().items()}
    corrected = learn(carts, CART, scale, base).model
    assert all(torch.equal(t, before[n]) for n, t in base.state_dict().items())
    base.loss_scale = scale
    losses = [mean_loss(model, carts.validation) for model in (corrected, base)]
    assert losses[0] < 0.2 * losses[1]


def test_processes_see_the_ground(rng):
    """The cart rolls downhill, which the map alone tells."""
    body = replace(CART, map_size=5.0, map_pixels=4)
    slope = torch.from_numpy(rng.uniform(-0.3, 0.3, (20, 10))).float()
    places = ((torch.arange(4) + 0.5) / 4 - 0.5) * 5.0
    maps = (slope[..., None, None] * places).expand(-1, -1, 4, 4).half()
    targets = torch.zeros(20, 10, 4)
    targets[..., 0] = -slope
    windows = Windows(torch.zeros(20, 10, 3), targets, maps)
    sets = Datasets(windows.first(15), windows.subset(range(15, 20)), windows)
    seeing = learn(sets, body).best_test_loss
    assert seeing < 0.01 * learn(sets, CART).best_test_loss


def test_what_processes_cannot_learn_from_is_one_line(monkeypatch):
    with pytest.raises(ConfigError, match="pass them, or take gp$"):
        refuse_method("gp_corrected", CART, None)
    other = replace(CART, columns=(("speed", "m/s"), ("yaw_rate", "rad/s")))
    with pytest.raises(ConfigError, match="the expert's least squares.*take gp$"):
        refuse_method("gp_corrected", CART, other)
    monkeypatch.setattr(boosting.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r'gp needs .* pip install "sidm\[trees\]"'):
        refuse_method("gp", CART, None)


def test_stored_processes_need_no_scikit_learn(carts):
    model = learn(carts, CART).model
    stored = model.state_dict()
    again = GaussianProcess(CART, Posterior(*(stored[n] for n in Posterior._fields)))
    expected, _ = model("novice", carts.test.inputs, carts.test.maps)
    predicted, _ = again("novice", carts.test.inputs, carts.test.maps)
    assert torch.equal(predicted, expected)
