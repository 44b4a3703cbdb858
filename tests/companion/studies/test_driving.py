"""Driving to goals: episodes, drivers and tables."""

import numpy as np
import pandas as pd
import pytest
import torch

from companion.engine.frame import records_frame
from companion.extensions.drivers import Driver, drive_episode, simulate_sequences
from companion.extensions.planning import Planning
from companion.studies.driving import measure as d
from companion.studies.driving.results import claims, rivals, scores, table
from sidm.config import to_mapping
from sidm.simulation import Simulator
from tests.companion.conftest import made


def test_trying_out_leaves_the_simulator_where_it_was():
    """Tried paths lead where real steps lead."""
    actions = torch.tensor([[[0.5, 0.2], [0.5, 0.2]], [[-0.3, 0.0], [0.1, 0.9]]])
    heights = d.episode("system1", 0).heights
    with Simulator(d.find_system("system1").novice, heights) as simulator:
        simulator.reset()
        simulator.step(np.array([0.4, 0.0]))
        before = simulator.state
        tried = simulate_sequences(simulator, actions.double()).numpy()
        assert np.allclose(simulator.state, before, atol=1e-9)
        for action in actions[0].double().numpy():
            simulator.step(action)
        assert np.allclose(tried[0, -1], simulator.state, atol=1e-6)
        assert np.allclose(tried[:, 0], before, atol=1e-9)


class Toy:
    """A robot on a line, at the sum of the throttles so far.

    Beyond 1 m the robot falls over or its state is lost.
    """

    def __init__(self, beyond: str) -> None:
        self.state = np.array([0, 0, 0, 0, 0, 0, 1, *[0] * 6], float)
        self.beyond = beyond

    def save(self):
        return self.state

    def restore(self, state):
        self.state = state
        return state

    def forget(self, token):
        pass

    def step(self, action):
        self.state = self.state.copy()
        self.state[0] += action[0]
        if self.state[0] > 1:
            self.state[3:7] = float("nan") if self.beyond == "lost" else (1, 0, 0, 0)
        return self.state

    def ended(self, state):
        if not np.isfinite(state).all():
            return "unstable"
        return "rollover" if state[3] == 1 else None


@pytest.mark.parametrize(
    ("beyond", "ended"), [("lost", "unstable"), ("rollover", "rollover")]
)
def test_what_falls_over_or_is_lost_goes_no_further(beyond, ended):
    """A tried path stays there, upside down; a ride ends there, short of its goal."""
    throttles = torch.tensor([[0.8, 0.8, 0.8], [0.1, 0.1, 0.1]], dtype=torch.float64)
    actions = torch.stack([throttles, 0 * throttles], -1)
    tried = simulate_sequences(Toy(beyond), actions).numpy()
    assert np.isfinite(tried).all()
    assert tried[1, :, 0] == pytest.approx([0, 0.1, 0.2, 0.3])
    assert tried[0, 2:, 3].tolist() == [1, 1] and tried[0, 3, 0] == tried[0, 2, 0]
    toy = Toy(beyond)
    # straight ahead at throttle 0.6, two steps to 1.2 m
    ride = drive_episode(toy, Driver(np.array([1.5, 0.0])), toy, 2.0)
    assert ride.ended == ended and len(ride.actions) == 2
    assert np.isfinite(ride.states).all()


@pytest.fixture
def driven(study):
    """Function that makes up episodes of a driver: some arrive, the others are stuck.

    Call `driven(method, minutes, arrived)`; without minutes a driver has no model.
    """

    def make(method, minutes, arrived, episodes=10, seed=0):
        path = tuple((0.1 * k, 0.05 * k) for k in range(30))
        numbers = tuple(range(seed, 3 * episodes, 3))
        trial = minutes and study.trial("system1", method, minutes, seed)
        return made(
            d.DrivingResult,
            d.DriverTest(
                system="system1",
                driver="model" if minutes else method,
                trial=trial or None,
                planning=None if method == "straight" else Planning(),
                episodes=numbers,
                longest=0.5,
            ),
            ended=("arrived",) * arrived + ("stuck",) * (episodes - arrived),
            seconds=(4.0,) * episodes,
            length=(6.6,) * episodes,
            away=(6.5,) * episodes,
            top_speed=(1.5,) * episodes,
            surprise=(0.1,) * episodes,
            plans=0 if method == "straight" else 20,
            plan_seconds=0.08,
            slowest_plan_seconds=0.1,
            paths=(path,) * sum(number < d.KEPT for number in numbers),
        )

    return make


def frame_of(found) -> pd.DataFrame:
    return records_frame(d.DrivingResult, map(to_mapping, found))


@pytest.fixture
def made_up(driven):
    """Results that improve with more data and with SIDM, in each of three seeds."""
    counts = {("sidm", 0.25): 4, ("novice_only", 0.25): 2}
    counts |= {("sidm", 0.75): 9, ("novice_only", 0.75): 7}
    models = [
        driven(*point, count, seed=seed)
        for point, count in counts.items()
        for seed in range(3)
    ]
    return [*models, driven("straight", 0, 0), driven("simulator", 0, 10)]


def test_scores_are_shares_and_medians(made_up):
    every = list(scores(frame_of(made_up)).itertuples())
    best, floor = every[2], every[4]
    expected = ("sidm", 0.75, "straight")
    assert (best.method, best.novice_minutes, floor.driver) == expected
    assert (best.models, best.episodes, best.arrived) == (3, 30, 0.9)
    assert 0.74 < best.low < 0.75 and 0.96 < best.high < 0.97  # Wilson's interval
    assert (best.seconds, best.length, best.ends) == (4, 6.6, "stuck 3")
    found = (best.detour, best.often, best.seldom, best.surprise)
    assert found == pytest.approx((1.1, 12.5, 10, 0.1))
    assert (floor.often, floor.seldom, floor.arrived, floor.models) == (0, 0, 0, 0)
    assert np.isnan([floor.seconds, floor.surprise]).all() and floor.ends == "stuck 10"


def test_claims_pair_seeds(made_up):
    """Two more goals of ten at both sizes; the same time where both arrive."""
    rows = claims(table(frame_of(made_up)))
    assert rows.value.tolist() == pytest.approx([-0.2, 0.0])
    assert rows.verdict.tolist() == ["In the same direction", "Not seen"]
    # results of one side only, and no results
    assert not any(len(claims(table(frame_of(some)))) for some in (made_up[:1], []))


@pytest.mark.parametrize(
    ("pairs", "more", "chance", "verdict"),
    [
        (((17, 3), (8, 8), (0, 0)), 14, 2**-13, "Not seen"),
        (((9, 7), (9, 7)), 4, 0.125, "No verdict"),
        (((0, 0),) * 3, 0, 1, "Not seen"),
    ],
)
def test_one_model_that_differs_makes_no_verdict(driven, pairs, more, chance, verdict):
    """Neither do two that differ alike, nor models that never arrive."""
    results = [
        driven(method, 0.75, count, 17, seed)
        for seed, pair in enumerate(pairs)
        for method, count in zip(("sidm", "novice_only"), pair, strict=True)
    ]
    rows = table(frame_of(results))
    one = rivals(rows).iloc[0]
    assert (one.more, one.fewer) == (more, 0) and one.chance == pytest.approx(chance)
    judged = claims(rows)
    # no goal, no time
    assert judged.verdict[0] == verdict and len(judged) == 1 + (pairs[0][0] > 0)
