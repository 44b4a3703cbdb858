"""Errors are those of the definitions, computed here step by step."""

import math

import numpy as np
import pytest
import torch

from ownrobot.fitting.errors import ONE_STEP, OPEN_LOOP
from ownrobot.fitting.model import WARM_UP, Model
from sidm.config import ConfigError, replace
from sidm.learning.model import Predictor
from sidm.settings import Network
from tests.ownrobot.cart import CART, cart_drive

IN_KMH = replace(CART, columns=(("speed", "km/h"),))


class Constant(Predictor):
    def __init__(self, transition):
        super().__init__()
        self.transition = torch.nn.Parameter(torch.tensor(transition), False)

    def loss_weights(self, role):
        return None

    def forward(self, role, inputs, maps, memory=None):
        return self.transition.expand(*inputs.shape[:2], -1), memory


def model_of(transition):
    return Model(
        predictor=Constant(transition),
        body=IN_KMH,
        network=Network(novice_body=IN_KMH, expert_body=IN_KMH),
        target_mean=torch.zeros(4),
        method="mean",
        steps=20,
        minutes=1.0,
        test_loss=0.0,
        scale=None,
    )


@pytest.fixture
def drives(rng):
    return [
        replace(
            cart_drive(rng, steps, "ab"[number % 2], f"{number}", turn=0.5, spin=0.1),
            body=IN_KMH,
        )
        for number, steps in enumerate((20, 20, 31))
    ]


def moved(before, after):
    dx, dy = after[:2] - before[:2]
    cos, sin = math.cos(before[2]), math.sin(before[2])
    return [cos * dx + sin * dy, cos * dy - sin * dx, after[2] - before[2]]


def rms(values):
    return math.sqrt(np.mean(np.square(values)))


def test_one_step_stands_beside_nothing_changes_and_the_mean(drives):
    table = model_of([0.1, 0.0, 0.02, 1.5]).evaluate(drives)
    table = table[table.prediction == ONE_STEP].set_index("quantity")
    pairs = [pair for d in drives for pair in zip(d.states, d.states[1:], strict=False)]
    actual = np.array([[*moved(a, b), b[3]] for a, b in pairs])
    before = np.array([a[3] for a, _ in pairs])
    forward, speed = table.loc["forward"], table.loc["speed"]
    assert forward.rmse == pytest.approx(rms(0.1 - actual[:, 0]), rel=1e-5)
    assert forward["nothing_changes"] == pytest.approx(rms(actual[:, 0]), rel=1e-5)
    assert forward["mean"] == pytest.approx(actual[:, 0].std(), rel=1e-5)
    assert speed["nothing_changes"] == pytest.approx(
        rms(actual[:, 3] - before), rel=1e-5
    )
    assert speed.average == pytest.approx(abs(1.5 - actual[:, 3]).mean(), rel=1e-5)
    middle = np.sort(abs(1.5 - actual[:, 3]))[(len(actual) - 1) // 2]
    assert speed["median"] == pytest.approx(middle, rel=1e-5)
    assert (speed.unit, forward.unit, forward.horizon) == ("m/s", "m", 0.1)


def test_open_loop_errors_are_those_of_each_horizon(drives):
    """All windows have 20 steps; the longest drive has two, which overlap."""
    table = model_of([0.1, 0.0, 0.02, 1.5]).evaluate(drives)
    ahead = table[(table.prediction == OPEN_LOOP) & (table.horizon.round(3) == 0.5)]
    ahead = ahead.set_index("quantity")
    starts = [(d, WARM_UP) for d in drives] + [(drives[2], 11 + WARM_UP)]
    path, ends, turns, speeds = [], [], [], []
    for drive, first in starts:
        state = drive.states[first].copy()
        for _ in range(5):
            state[:2] += 0.1 * np.array([math.cos(state[2]), math.sin(state[2])])
            state[2] += 0.02
        path.append(np.hypot(*(state - drive.states[first + 5])[:2]))
        *end, turn = moved(drive.states[first], drive.states[first + 5])
        ends.append(end)
        turns.append(turn)
        speeds.append([drive.states[first, 3], drive.states[first + 5, 3]])
    position, heading, speed = (ahead.loc[n] for n in ("position", "heading", "speed"))
    assert position.rmse == pytest.approx(rms(path), rel=1e-5)
    assert position["nothing_changes"] == pytest.approx(
        rms(np.hypot(*np.transpose(ends))), rel=1e-5
    )
    off = np.array(ends) - np.mean(ends, 0)
    assert position["mean"] == pytest.approx(rms(np.hypot(*off.T)), rel=1e-5)
    assert heading["nothing_changes"] == pytest.approx(rms(turns), rel=1e-5)
    assert heading.rmse == pytest.approx(rms(0.1 - np.array(turns)), rel=1e-4)
    start, end = np.transpose(speeds)
    assert speed["nothing_changes"] == pytest.approx(rms(end - start), rel=1e-5)


def test_predictions_have_units_and_go_over_a_horizon(drives):
    model = model_of([0.1, 0.0, 0.02, 1.5])
    one = model.predict(drives)
    assert list(one.columns[:3]) == ["drive", "time [s]", "predicted forward [m]"]
    speeds = np.concatenate([drive.states[1:, 3] for drive in drives])
    assert np.allclose(one["actual speed [m/s]"], speeds)
    ahead = model.predict(drives, horizon=0.5, every=10)
    assert len(ahead) == 5 * (2 + 2 + 3) + 1  # the last start has one step
    rows = ahead[(ahead.drive == "2") & (ahead["start [s]"] == 1.0)]
    path = model.rollout(drives[2].states[10], drives[2].actions[10:15])
    assert np.allclose(rows["predicted x [m]"], path[1:, 0])
    assert np.allclose(rows["actual yaw [rad]"], drives[2].states[11:16, 2])
    assert np.allclose(rows["time [s]"], [1.1, 1.2, 1.3, 1.4, 1.5])
    from_start = model.predict(drives, horizon=9.0)
    assert len(from_start) == 71  # up to the end of each drive
    for wrong in ({"horizon": 0.01}, {"horizon": 1.0, "every": 0}):
        with pytest.raises(ConfigError, match="horizon|every"):
            model.predict(drives, **wrong)
