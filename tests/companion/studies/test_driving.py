"""Driving to goals: episodes, drivers, tables and figures."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
import torch

from companion import Study
from companion.beyond.drivers import Driver, drive_episode, simulate_sequences
from companion.beyond.planning import Planning
from companion.engine.frame import records_frame
from companion.studies.driving import measure as d
from companion.studies.driving.results import claims, rivals, scores, table
from sidm.simulation import Simulator
from tests.companion.conftest import made


@pytest.fixture(scope="module")
def jobs(tiny, data, tmp_path_factory):
    """A job of each driver; the model is of system 1 and the largest tiny dataset."""
    study = Study(tiny, data, tmp_path_factory.mktemp("results"))
    trial, corrected = (
        study.trial("system1", method, 0.75) for method in ("sidm", "corrected")
    )
    plain = dict(system="system1", episodes=(0,), longest=0.5)
    small = Planning(samples=3, elites=2, horizon=4, hold=2)
    return {
        "model": d.DriverTest(driver="model", trial=trial, planning=small, **plain),
        "corrected": d.DriverTest(
            driver="model", trial=corrected, planning=small, **plain
        ),
        "simulator": d.DriverTest(
            driver="simulator",
            trial=None,
            planning=dataclasses.replace(small, replan=2),
            **plain,
        ),
        "straight": d.DriverTest(driver="straight", trial=None, planning=None, **plain),
    }


def test_episodes_are_the_same_for_all_and_differ():
    first = d.episode("system1", 0)
    repeated = d.episode("system1", 0)
    second = d.episode("system1", 1)
    assert np.array_equal(first.heights, repeated.heights)
    assert np.array_equal(first.goal, repeated.goal)
    assert not np.array_equal(first.heights, second.heights)
    away = [np.linalg.norm(d.episode("system1", number).goal) for number in range(20)]
    assert d.NEAREST <= min(away) < max(away) <= d.FARTHEST


def test_trying_out_leaves_the_simulator_where_it_was():
    """Tried paths lead where real steps lead."""
    actions = torch.tensor(
        [[[0.5, 0.2], [0.5, 0.2]], [[-0.3, 0.0], [0.1, 0.9]]], dtype=torch.float64
    )
    one = d.episode("system1", 0)
    with Simulator(d.find_system("system1").novice, one.heights) as simulator:
        simulator.reset()
        simulator.step(np.array([0.4, 0.0]))
        before, tried = simulator.state, simulate_sequences(simulator, actions).numpy()
        assert np.allclose(simulator.state, before, atol=1e-9)
        for action in actions[0].numpy():
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
        return None if np.isfinite(state).all() else "unstable"


@pytest.mark.parametrize("beyond", ["lost", "rollover"])
def test_what_falls_over_or_is_lost_is_tried_no_further(beyond):
    """The robot stays at that place, upside down."""
    actions = torch.tensor(
        [[[0.8, 0], [0.8, 0], [0.8, 0]], [[0.1, 0], [0.1, 0], [0.1, 0]]],
        dtype=torch.float64,
    )
    tried = simulate_sequences(Toy(beyond), actions).numpy()
    assert np.isfinite(tried).all()
    assert tried[1, :, 0] == pytest.approx([0, 0.1, 0.2, 0.3])
    assert tried[0, 2:, 3].tolist() == [1, 1] and tried[0, 3, 0] == tried[0, 2, 0]


def test_a_ride_whose_numbers_are_lost_ends_there():
    """The ride is kept up to that step.

    A robot that falls over within reach of its goal has not arrived.
    """
    toy = Toy("lost")
    driver = Driver(np.array([3.0, 0.0]))  # straight ahead at throttle 0.6
    lost = drive_episode(toy, driver, toy, 2.0)
    assert lost.ended == "unstable"
    assert len(lost.actions) == 2
    assert np.isfinite(lost.states).all()
    toy = Toy("rollover")
    toy.ended = lambda state: "rollover" if state[3] == 1 else None
    assert (
        drive_episode(toy, Driver(np.array([1.5, 0.0])), toy, 2.0).ended == "rollover"
    )


def driven(
    about: d.DriverTest, arrived: int, episodes: int = 10, seed: int = 0
) -> d.DrivingResult:
    """Made-up episodes: some robots arrive, the others are stuck."""
    path = tuple((0.1 * k, 0.05 * k) for k in range(30))
    numbers = tuple(range(seed, 3 * episodes, 3))
    trial = about.trial and about.trial.replace(seed=seed)
    return made(
        d.DrivingResult,
        dataclasses.replace(about, episodes=numbers, trial=trial),
        ended=("arrived",) * arrived + ("stuck",) * (episodes - arrived),
        seconds=(4.0,) * episodes,
        length=(6.6,) * episodes,
        away=(6.5,) * episodes,
        top_speed=(1.5,) * episodes,
        surprise=(0.1,) * episodes,
        plans=0 if about.driver == "straight" else 20,
        plan_seconds=0.08,
        slowest_plan_seconds=0.1,
        paths=(path,) * sum(number < d.KEPT for number in numbers),
    )


def frame_of(found) -> pd.DataFrame:
    return records_frame(d.DrivingResult, found)


@pytest.fixture
def made_up(jobs):
    """Results that improve with more data and with SIDM, in each of three seeds."""
    results = []
    for minutes, counts in ((0.25, (4, 2)), (0.75, (9, 7))):
        for method, count in zip(("sidm", "novice_only"), counts, strict=True):
            trial = jobs["model"].trial.replace(method=method, novice_minutes=minutes)
            about = dataclasses.replace(jobs["model"], trial=trial)
            results += [driven(about, count, seed=seed) for seed in range(3)]
    return [*results, driven(jobs["straight"], 0), driven(jobs["simulator"], 10)]


def test_scores_are_shares_and_medians(made_up):
    every = list(scores(frame_of(made_up)).itertuples())
    best, floor = every[2], every[4]
    expected = ("sidm", 0.75, "straight")
    assert (best.method, best.novice_minutes, floor.driver) == expected
    assert (best.models, best.episodes, best.arrived) == (3, 30, 0.9)
    assert 0.74 < best.low < 0.75 and 0.96 < best.high < 0.97  # Wilson's interval
    assert best.seconds == 4
    assert best.detour == pytest.approx(1.1)
    assert best.ends == "stuck 3"
    assert best.length == 6.6
    assert (best.often, best.seldom) == pytest.approx((12.5, 10))
    assert (floor.often, floor.seldom) == (0, 0)
    assert floor.arrived == 0
    assert np.isnan(floor.seconds)
    assert floor.ends == "stuck 10"
    assert floor.models == 0
    assert np.isnan(floor.surprise) and best.surprise == pytest.approx(0.1)


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
def test_one_model_that_differs_makes_no_verdict(jobs, pairs, more, chance, verdict):
    """One differing model of three gives no verdict, for any number of episodes.

    Neither do two that differ alike, nor models that never arrive.
    """
    trials = [
        jobs["model"].trial.replace(method=method) for method in ("sidm", "novice_only")
    ]
    rows = table(
        frame_of(
            driven(dataclasses.replace(jobs["model"], trial=trial), count, 17, seed)
            for seed, pair in enumerate(pairs)
            for trial, count in zip(trials, pair, strict=True)
        )
    )
    one = rivals(rows).iloc[0]
    assert (one.more, one.fewer) == (more, 0) and one.chance == pytest.approx(chance)
    judged = claims(rows)
    # no goal, no time
    assert judged.verdict[0] == verdict and len(judged) == 1 + (pairs[0][0] > 0)
