"""Driving to a goal over unseen ground, with plans or straight ahead.

Plans are made with a learned model or with the simulator itself.

`companion run --figure driving` makes the results that are not stored in
results/driving.jsonl yet.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from companion.engine.execute import predictor_of
from companion.engine.library import Library
from companion.engine.outcomes import evaluate
from companion.engine.provenance import Provenance
from companion.engine.records import ProvenanceTimer, by_field, records_of
from companion.extensions.drivers import Driver, drive_episode
from companion.extensions.planning import ModelImagination, Planner, Planning
from companion.methods import COMPARED
from companion.study import Study
from companion.trials import Trial
from sidm.config import config
from sidm.drives import CONTROL_STEP, TWIST, upright
from sidm.learning.arithmetic import one_thread
from sidm.learning.model import Predictor
from sidm.systems import find_system
from sidm.terrain import generate_terrain

#: methods whose models drive; the last one needs the least data here
DRIVEN = (*COMPARED, "corrected_averaged")
SIZES = (1.0, 5.0, 60.0)  # min of novice data that the models have learned from
EPISODES, EPISODES_SIMULATED = 50, 10
GOAL_SEED = 4  # differs from the seeds of all data
NEAREST, FARTHEST = 5.0, 8.0  # m, from the start to the goal
LONGEST = 20.0  # s, length of an episode at most
KEPT = 10  # number of first episodes whose paths are stored


@config
class DriverTest:
    """Episodes with one driver."""

    system: str
    driver: Literal["model", "simulator", "straight"]
    trial: Trial | None = None  # of the model
    planning: Planning | None = None  # None for the driver that does not plan
    episodes: tuple[int, ...]  # numbers of the episodes
    longest: float  # s, length of an episode at most


@config
class DrivingResult:
    """Results of a DriverTest with E episodes."""

    about: DriverTest
    #: (E,) 'arrived', a cause of `shards.DISCARDS`, or 'time'
    ended: tuple[str, ...]
    seconds: tuple[float, ...]  # (E,) s, of driving until the end
    length: tuple[float, ...]  # (E,) m, of the path
    away: tuple[float, ...]  # (E,) m, distance from the goal at the start
    left: tuple[float, ...]  # (E,) m, distance from the goal at the end
    throttle: tuple[float, ...]  # (E,) mean magnitude
    top_speed: tuple[float, ...]  # (E,) m/s
    steepest: tuple[float, ...]  # (E,) degrees, largest tilt
    #: (E,) m, mean distance between where a plan led and where the robot was at the
    #: next plan; 0 without plans
    surprise: tuple[float, ...]
    validation_loss: float  # of the model, equation (1); 0 without a model
    #: m, of the model after 2.5 s, mean over the rollouts of the trial; 0 without a
    #: model
    position_error: float
    plans: int  # number of plans
    #: s on one thread, median per plan; includes updating the model by the steps since
    #: the last plan
    plan_seconds: float
    slowest_plan_seconds: float  # s, 95 % quantile of the same times
    #: (K + 1, 2) m, x and y at each control step, of each episode below KEPT
    paths: tuple[tuple[tuple[float, float], ...], ...]
    provenance: Provenance


#: the stored results, under a folder of results
records = records_of(DrivingResult, "driving")


class Episode(NamedTuple):
    """A start and a goal on a ground that no data have."""

    heights: np.ndarray  # (H, W), m
    yaw: float  # rad, at the start, which is the origin
    goal: np.ndarray  # (2,) x and y, m


def episode(system: str, number: int) -> Episode:
    """Episode `number` of a system, the same for all drivers."""
    rng = np.random.default_rng(np.random.SeedSequence(GOAL_SEED, spawn_key=(number,)))
    terrain_seed, yaw = int(rng.integers(2**62)), float(rng.uniform(-np.pi, np.pi))
    away, bearing = rng.uniform(NEAREST, FARTHEST), rng.uniform(-np.pi, np.pi)
    heights = generate_terrain(find_system(system).terrain, terrain_seed)
    return Episode(heights, yaw, away * np.array([np.cos(bearing), np.sin(bearing)]))


def jobs(
    study: Study,
    system: str,
    sizes: Iterable[float] = SIZES,
    episodes: int = EPISODES,
    simulated: int = EPISODES_SIMULATED,
    longest: float = LONGEST,
) -> list[DriverTest]:
    """The tests of all drivers on a system, whose novice drives on its ground.

    `sizes` are those of the models' data, min. The models of a method and size, one per
    seed, share the `episodes` out among them; the first `simulated` of the same
    episodes are planned in the simulator. An episode takes `longest` s at most.
    """
    test = functools.partial(DriverTest, system=system, longest=longest)
    seeds = study.preset.seeds
    available = study.preset.sizes_in_pool(system, sizes)
    models = [
        test(
            driver="model",
            trial=trial,
            planning=Planning(),
            episodes=tuple(range(trial.seed, episodes, seeds)),
        )
        for trial in study.points(system, DRIVEN, available, seeds=seeds)
        if trial.seed < episodes
    ]
    first = tuple(range(simulated))
    return [
        test(driver="simulator", planning=Planning(), episodes=first),
        *models,
        test(driver="straight", episodes=tuple(range(episodes))),
    ]


def measure(about: DriverTest, data: str | Path = "data") -> DrivingResult:
    """Drive all episodes of a test; without PyBullet there is an ImportError."""
    from sidm.simulation import Simulator
    from sidm.simulation.collecting import EpisodeRules

    timer, trial = ProvenanceTimer("driving", about.trial, data), about.trial
    system = find_system(about.system)
    pace: list[float] = []
    episodes, paths = [], []
    loss, error = 0.0, 0.0
    with one_thread():
        model = predictor_of(trial, data) if trial else None
        for number in about.episodes:
            task = episode(about.system, number)
            with Simulator(system.novice, task.heights, system.physics) as simulator:
                driver = _driver(about, model, simulator, task, number)
                start = simulator.reset(yaw=task.yaw)
                rules = EpisodeRules(start, system.terrain.half_width)
                ended, states, actions = drive_episode(
                    simulator, driver, rules, about.longest
                )
            path = states[:, :2]
            pace += driver.pace
            found = {
                "seconds": CONTROL_STEP * len(actions),
                "length": np.linalg.norm(np.diff(path, axis=0), axis=1).sum(),
                "away": np.linalg.norm(task.goal),
                "left": np.linalg.norm(path[-1] - task.goal),
                "throttle": np.abs(actions[:, 0]).mean(),
                "top_speed": np.linalg.norm(states[:, TWIST][:, :2], axis=1).max(),
                "steepest": np.degrees(
                    np.arccos(np.clip(upright(states), -1, 1)).max()
                ),
                "surprise": np.mean(driver.surprises) if driver.surprises else 0.0,
            }
            numbers = {name: float(value) for name, value in found.items()}
            episodes.append({"ended": ended} | numbers)
            if number < KEPT:
                paths.append(path.tolist())
        if model and trial:
            errors = evaluate(model, trial, Library(data))
            loss, error = float(errors.losses.sum()), float(errors.position[-1])
    return DrivingResult(
        about=about,
        **by_field(episodes),
        validation_loss=loss,
        position_error=error,
        plans=len(pace),
        plan_seconds=float(np.median(pace)) if pace else 0.0,
        slowest_plan_seconds=float(np.percentile(pace, 95)) if pace else 0.0,
        paths=tuple(paths),
        provenance=timer.done(),
    )


def _driver(
    about: DriverTest,
    model: Predictor | None,
    simulator: Any,
    task: Episode,
    number: int,
) -> Driver:
    if about.planning is None:
        return Driver(task.goal)
    imagination = simulator
    if model and about.trial:
        pixels, horizon = about.trial.network.pixels, about.planning.horizon
        imagination = ModelImagination(model, task.heights, pixels, horizon)
    return Driver(task.goal, Planner(about.planning, task.goal, number), imagination)
