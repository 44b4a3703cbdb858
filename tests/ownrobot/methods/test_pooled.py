"""Samples of two robots as one, and least squares on those of the expert."""

import numpy as np
import pytest
import torch

from ownrobot.fitting.learning import learn, network_for, refuse_method
from ownrobot.fitting.settings import SETTINGS
from ownrobot.methods import gaussian_fitting, least_squares, pooled
from ownrobot.methods.registry import METHODS
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
ALONE = {"trees": "trees", "least_squares": "least_squares", "gp": "gp"}
POOLED = [name for name, method in METHODS.items() if method.pooled]
CORRECTED = ["least_squares_corrected", "trees_corrected", "gp_corrected"]


def motion(rng, windows: int, gain: float, steps: int = 6) -> Windows:
    """A cart whose throttle pushes with a gain, and turns it."""
    throttle, steering = np.moveaxis(rng.uniform(-1, 1, (windows, steps, 2)), 2, 0)
    speeds = np.zeros((windows, steps + 1))
    for step in range(steps):
        push = gain * (throttle + 0.3 * throttle * steering)[:, step]
        speeds[:, step + 1] = 0.8 * speeds[:, step] + push
    before, after = speeds[:, :-1], speeds[:, 1:]
    turn = 0.1 * steering * after
    targets = np.stack([0.1 * after, 0 * turn, turn, after], -1)
    targets += rng.normal(0, 0.05, targets.shape) * targets.std((0, 1))
    x = np.stack([before, throttle, steering], -1)
    inputs, targets = (torch.from_numpy(part).float() for part in (x, targets))
    return Windows(inputs, targets, torch.zeros(windows, steps, 0, 0))


@pytest.fixture(autouse=True)
def few_samples(monkeypatch):
    """A smooth law without much noise needs few for its kernels."""
    monkeypatch.setattr(gaussian_fitting, "KERNEL_SAMPLES", 150)


@pytest.fixture
def carts(rng) -> Datasets:
    """A twentieth of the expert's motion of a novice that is weaker by a fifth."""
    validation, expert = motion(rng, 40, 0.8), motion(rng, 80, 1.0)
    return Datasets(motion(rng, 3, 0.8), motion(rng, 1, 0.8), validation, expert)


def learnt(method: str, sets: Datasets):
    network = network_for(SETTINGS, CART, CART)
    return learn(method, sets, network, 1).model


@pytest.mark.parametrize("method", [*POOLED, *CORRECTED])
def test_the_expert_helps_with_little_data(carts, method):
    alone = ALONE[method.rpartition("_")[0]]
    losses = [
        mean_loss(learnt(name, carts), carts.validation) for name in (method, alone)
    ]
    assert losses[0] < 0.8 * losses[1]


@pytest.mark.parametrize("method", POOLED)
def test_the_flag_tells_the_robots_apart(rng, carts, method):
    """With the flag of the expert, the same model predicts a stronger push."""
    model = learnt(method, carts._replace(train=motion(rng, 40, 0.8)))
    inputs, maps = carts.validation.inputs, carts.validation.maps
    rows = pooled.with_flag(inputs, False)
    of_novice, _ = model("novice", inputs, maps)
    of_expert, _ = model.inner("novice", rows, maps)
    pushes = [
        (predicted[..., 3] - 0.8 * inputs[..., 0]).abs().mean()
        for predicted in (of_novice, of_expert)
    ]
    assert pushes[0] < 0.95 * pushes[1]


@pytest.mark.parametrize("method", [*POOLED, *CORRECTED])
def test_it_drives_the_same_with_the_same_seed(carts, method):
    actions = torch.tensor([[0.5, 0.2]]).expand(20, -1)
    paths = [
        rollout(learnt(method, carts), None, torch.zeros(4), actions, 0, body=CART)
        for _ in range(2)
    ]
    assert torch.equal(*paths) and torch.isfinite(paths[0]).all()


def test_the_flag_stands_in_front(carts, monkeypatch):
    monkeypatch.setattr(pooled, "MOST_EXPERT_SAMPLES", 35)
    sets = pooled.pooled_datasets(carts, 0)
    assert len(sets.expert) == 5  # windows of six steps
    assert (sets.train.inputs[..., 0] == 1).all()
    assert (sets.expert.inputs[..., 0] == 0).all()
    assert torch.equal(sets.train.inputs[..., 1:], carts.train.inputs)
    again = pooled.pooled_datasets(carts, 0)
    assert torch.equal(sets.expert.inputs, again.expert.inputs)
    assert len(pooled.joined(sets.train, sets.expert)) == 8
    with pytest.raises(ConfigError, match="need the expert's data"):
        pooled.pooled_datasets(carts._replace(expert=None), 0)


def test_another_robots_windows_count_in_no_fold(carts):
    """Penalties are chosen for the novice: the loss is that of its steps alone."""
    units = Standardisation.fit(carts.train)
    fitted = least_squares.fit(carts, units, further=carts.expert)
    shuffled = replace(carts.expert, stored_targets=100 + carts.expert.targets)
    spoilt = least_squares.fit(carts, units, further=shuffled)
    assert fitted.best_test_loss < 0.05 < 1e3 < spoilt.best_test_loss
    assert fitted.samples == 24 + 480


def test_what_needs_robots_of_one_body_is_one_line():
    other = replace(CART, columns=(("speed", "m/s"), ("yaw_rate", "rad/s")))
    with pytest.raises(ConfigError, match="samples of both robots as one.*take trees$"):
        refuse_method("trees_pooled", CART, other)
    with pytest.raises(ConfigError, match="corrects the expert's least squares"):
        refuse_method("least_squares_corrected", CART, other)
    with pytest.raises(ConfigError, match="pass them, or take least_squares$"):
        refuse_method("least_squares_pooled", CART, None)
    with pytest.raises(ConfigError, match="pass them, or take novice_only$"):
        refuse_method("corrected", CART, None)
