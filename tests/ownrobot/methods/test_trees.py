"""Boosted trees: as tensors they predict like scikit-learn's, and learn a bent law."""

import numpy as np
import pytest
import torch
from sklearn.ensemble import HistGradientBoostingRegressor

from ownrobot.fitting.learning import refuse_method
from ownrobot.methods import boosting, least_squares
from ownrobot.methods.forest import Forest
from ownrobot.methods.map_features import NAMES, map_features
from ownrobot.methods.trees import Trees, features
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


def motion(rng, windows: int, gain: float = 1.0, steps: int = 20) -> Windows:
    """A cart whose throttle has a dead zone and whose brake is stronger."""
    actions = np.repeat(rng.uniform(-1, 1, (windows, steps // 5, 2)), 5, axis=1)
    throttle, steering = np.moveaxis(actions, 2, 0)
    push = np.where(np.abs(throttle) < 0.4, 0.0, gain * np.sign(throttle))
    speeds = np.zeros((windows, steps + 1))
    for step in range(steps):
        speeds[:, step + 1] = np.clip(0.9 * speeds[:, step] + push[:, step], 0, 3)
    before, after = speeds[:, :-1], speeds[:, 1:]
    turn = 0.05 * after * np.where(np.abs(steering) < 0.3, 0.0, np.sign(steering))
    targets = [0.1 * after, 0 * turn, turn, after]
    x, y = (
        torch.from_numpy(np.stack(part, -1)).float()
        for part in ([before, throttle, steering], targets)
    )
    return Windows(x, y, torch.zeros(windows, steps, 0, 0))


@pytest.fixture
def carts(rng) -> Datasets:
    return Datasets(
        motion(rng, 60), motion(rng, 20), motion(rng, 20), motion(rng, 60, gain=0.6)
    )


def scale_of(sets: Datasets) -> torch.Tensor:
    """Weights of the components; the second is constant and has none."""
    variance = sets.train.targets.var((0, 1))
    return torch.where(variance > 0, 1 / variance, 0.0)


def test_tensors_predict_what_scikit_learn_predicts(rng):
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
    kept = torch.from_numpy(fresh[:600])
    assert np.allclose(forest.predict(kept), predicted[:600])  # with no number missing


def test_trees_learn_a_bent_law_better_than_least_squares(carts):
    scale = scale_of(carts)
    trained = boosting.learn(carts, CART, scale)
    units = Standardisation.fit(carts.train)
    squares = least_squares.fit(carts, units, scale=scale)
    losses = [mean_loss(some.model, carts.validation) for some in (trained, squares)]
    assert losses[0] < 0.5 * losses[1]
    assert losses[0] < trained.best_test_loss < losses[1]
    predicted, _ = trained.model("novice", carts.test.inputs, carts.test.maps)
    assert (predicted[..., 1] == 0).all()  # what never varies is its mean


def test_the_same_seed_grows_the_same_trees(carts):
    first, second = (boosting.learn(carts, CART, seed=3).model for _ in range(2))
    weights = second.state_dict()
    assert all(torch.equal(w, weights[n]) for n, w in first.state_dict().items())
    assert weights["threshold"].dtype == torch.float64


def test_the_memory_is_the_x_before(carts):
    """Step by step, with the memory, the model predicts what it predicts at once."""
    model = boosting.learn(carts, CART).model
    inputs, maps = carts.test.inputs, carts.test.maps
    whole, _ = model("novice", inputs, maps)
    memory, steps = None, []
    for step in range(inputs.shape[1]):
        now = slice(step, step + 1)
        predicted, memory = model("novice", inputs[:, now], maps[:, now], memory)
        steps.append(predicted)
    assert torch.equal(torch.cat(steps, 1), whole)
    seen = features(inputs, maps, CART)
    assert torch.equal(seen[:, 0, :3], seen[:, 0, 3:])
    assert torch.equal(seen[:, 1, 3:], seen[:, 0, :3])


def test_trees_drive(carts):
    model = boosting.learn(carts, CART).model
    actions = torch.tensor([[1.0, 1.0]]).expand(60, -1)
    path = rollout(model, None, torch.zeros(4), actions, 0, body=CART)
    assert float(path[-1, 3]) == pytest.approx(3.0, abs=0.3)  # the law's top speed
    turns = torch.diff(path[-10:, 2])
    assert np.allclose(turns, 0.15, atol=0.02)


@pytest.mark.more
def test_a_correction_of_the_experts_trees_helps_with_little_data(rng, carts):
    little = carts._replace(train=motion(rng, 15), test=motion(rng, 5))
    scale = scale_of(carts)
    alone, corrected = (
        mean_loss(boosting.learn(little, CART, scale, expert).model, carts.validation)
        for expert in (False, True)
    )
    expert = carts._replace(train=carts.expert, test=carts.expert)
    of_expert = boosting.learn(expert, CART, scale).model
    assert corrected < 0.9 * alone
    assert corrected < 0.9 * mean_loss(of_expert, carts.validation)


def test_a_few_seconds_grow_trees_too(rng):
    sets = Datasets(motion(rng, 2), motion(rng, 1), motion(rng, 1))
    model = boosting.learn(sets, CART).model
    assert len(model.forest.roots) > 0
    assert torch.isfinite(model("novice", sets.test.inputs, sets.test.maps)[0]).all()


def test_trees_see_the_ground(rng):
    """The cart rolls downhill, which the map alone tells."""
    body = replace(CART, map_size=5.0, map_pixels=8)
    slope = torch.from_numpy(rng.uniform(-0.3, 0.3, (40, 20))).float()
    places = ((torch.arange(8) + 0.5) / 8 - 0.5) * 5.0
    maps = (slope[..., None, None] * places).expand(-1, -1, 8, 8).half()
    targets = torch.zeros(40, 20, 4)
    targets[..., 0] = -slope
    windows = Windows(torch.zeros(40, 20, 3), targets, maps)
    sets = Datasets(windows.first(30), windows.subset(range(30, 40)), windows)
    seeing = boosting.learn(sets, body).best_test_loss
    assert seeing < 0.01 * boosting.learn(sets, CART).best_test_loss


def test_the_map_in_numbers():
    """Of a tilted plane and a bowl, the numbers are their formulas'."""
    places = ((torch.arange(32) + 0.5) / 32 - 0.5) * 5.0
    y, x = torch.meshgrid(places, places, indexing="ij")
    surface = 0.3 + 0.2 * x - 0.1 * y + 0.5 * (x**2 + y**2) / 2
    found = dict(zip(NAMES, map_features(surface[None], 5.0)[0].tolist(), strict=True))
    assert found["height"] == pytest.approx(0.3, abs=1e-4)
    assert found["slope along"] == pytest.approx(0.2, abs=1e-4)
    assert found["slope across"] == pytest.approx(-0.1, abs=1e-4)
    assert found["curvature"] == pytest.approx(0.5, abs=1e-4)
    bend = 0.5 / 24  # the mean of (x^2 + y^2) / 4 over a metre's square
    assert found["cell +0 +0"] == pytest.approx(0.3 + 2 * bend, abs=0.01)
    ahead = 0.3 + 0.2 + 0.25 + 2 * bend
    assert found["cell +1 +0"] == pytest.approx(ahead, abs=0.03)
    left = 0.3 - 0.1 + 0.25 + 2 * bend
    assert found["cell +0 +1"] == pytest.approx(left, abs=0.03)


@pytest.mark.parametrize("pixels", [1, 2, 3, 4, 8])
def test_a_coarse_map_has_all_numbers(pixels):
    found = map_features(torch.full((2, 3, pixels, pixels), 0.5).half(), 5.0)
    assert found.shape == (2, 3, len(NAMES))
    assert torch.allclose(found[..., 4:], torch.tensor(0.5))


def test_what_trees_cannot_learn_from_is_one_line(monkeypatch):
    with pytest.raises(ConfigError, match="learns from an expert's drives too.*trees"):
        refuse_method("trees_corrected", CART, None)
    other = replace(CART, columns=(("speed", "m/s"), ("yaw_rate", "rad/s")))
    with pytest.raises(ConfigError, match="corrects the expert's trees.*one body"):
        refuse_method("trees_corrected", CART, other)
    monkeypatch.setattr(boosting.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r'pip install "sidm\[trees\]"'):
        refuse_method("trees", CART, None)


def test_stored_trees_need_no_scikit_learn(carts):
    model = boosting.learn(carts, CART).model
    again = Trees(CART, Forest(*(model.state_dict()[n] for n in Forest._fields)))
    expected, _ = model("novice", carts.test.inputs, carts.test.maps)
    predicted, _ = again("novice", carts.test.inputs, carts.test.maps)
    assert torch.equal(predicted, expected)
