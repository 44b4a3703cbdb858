"""Driving to a goal over unseen ground: planned on a learned model, on the simulator itself, or straight ahead.

`companion run --figure driving` makes what is not stored of it in results/driving.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from companion.beyond.drivers import Driver, Ride, ride
from companion.beyond.planning import Dreamer, Planner, Planning
from companion.engine.execute import Library, judge
from companion.engine.models import predictor_of
from companion.engine.provenance import Provenance
from companion.engine.records import Making, by_field, records_of
from companion.methods import COMPARED
from companion.study import Study
from companion.trials import Trial
from sidm.config import ConfigError, config
from sidm.learning.arithmetic import one_thread
from sidm.learning.model import Predictor
from sidm.systems import find_system
from sidm.terrain import generate_terrain

#: whose models; the last is what needs least data here
DRIVEN = (*COMPARED, "corrected_averaged")
SIZES = (1.0, 5.0, 60.0)  # of the novice's data that the models have learnt from, min
EPISODES, EPISODES_SIMULATED = 50, 10
GOAL_SEED = 4  # apart from the seeds of all data
NEAREST, FARTHEST = 5.0, 8.0  # of a goal from the start, m
LONGEST = 20.0  # s of an episode
KEPT = 10  # the first episodes, whose paths are stored

Kind = Literal["model", "simulator", "straight"]


@config
class DriverTest:
    """Episodes with one driver."""

    system: str
    driver: Kind
    trial: Trial | None  # that the model is of; None for the other drivers
    planning: Planning | None  # None for the driver who does not plan
    episodes: tuple[int, ...]  # by their numbers
    longest: float  # s of an episode

    def __post_init__(self) -> None:
        """Refuse a drive without an episode."""
        if not self.episodes or min(self.episodes) < 0:
            raise ConfigError(
                f"DriverTest.episodes must be numbers from 0 on, not {self.episodes}"
            )


@config
class Driven:
    """What came of it; E episodes."""

    about: DriverTest
    #: (E,) 'arrived', a cause of `trajectory.DISCARDS`, or 'time'
    ended: tuple[str, ...]
    seconds: tuple[float, ...]  # (E,) of driving until then
    length: tuple[float, ...]  # (E,) m, of the path
    away: tuple[float, ...]  # (E,) m, from the goal at the start
    left: tuple[float, ...]  # (E,) m, from the goal at the end
    throttle: tuple[float, ...]  # (E,) mean of its size
    top_speed: tuple[float, ...]  # (E,) m/s
    steepest: tuple[float, ...]  # (E,) degrees, of tilt
    #: (E,) m, from where a plan led to where the robot was at the next, mean; 0 of no
    #: plan
    surprise: tuple[float, ...]
    validation_loss: float  # equation (1) of the model; 0 of drivers without
    #: m, of the model after 2.5 s, mean over the rollouts of the trial; 0 of drivers
    #: without
    position_error: float
    plans: int
    #: median, of a plan, what was done since the one before taken in, on one thread
    plan_seconds: float
    slowest_plan_seconds: float  # which 95 % of the plans do not take
    #: of the episodes below KEPT: x and y, m, at each control step
    paths: tuple[tuple[tuple[float, float], ...], ...]
    provenance: Provenance


#: where they are kept, under a folder of results
records = records_of(Driven, "driving")


class Episode(NamedTuple):
    """A start and a goal on a ground that no data have."""

    heights: np.ndarray  # (H, W), m
    yaw: float  # at the start, which is the origin, rad
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
    """All that are compared on a system.

    Args:
        study: whose models; those of a method and size, one a seed, share the episodes
            out among them.
        system: whose novice and ground.
        sizes: of the models' data, min.
        episodes: of a method and size, and of the straight driver.
        simulated: of the planner in the simulator, the first of the same.
        longest: s of an episode.
    """

    def one(
        driver: Kind,
        planning: Planning | None,
        numbers: Iterable[int],
        trial: Trial | None = None,
    ) -> DriverTest:
        return DriverTest(
            system=system,
            driver=driver,
            trial=trial,
            planning=planning,
            episodes=tuple(numbers),
            longest=longest,
        )

    seeds = study.preset.seeds
    trials = study.points(system, DRIVEN, study.preset.held(system, sizes), seeds=seeds)
    models = [
        one("model", Planning(), range(t.seed, episodes, seeds), t)
        for t in trials
        if t.seed < episodes
    ]
    return [
        one("simulator", Planning(), range(simulated)),
        *models,
        one("straight", None, range(episodes)),
    ]


def measure(about: DriverTest, data: str | Path = "data") -> Driven:
    """Drive all episodes of one driver; ImportError without PyBullet, in one line."""
    from sidm.simulation import Simulator
    from sidm.simulation.collecting import EpisodeRules

    making, system = Making("driving", about.trial, data), find_system(about.system)
    pace: list[float] = []
    driven, paths = [], []
    with one_thread():
        model = predictor_of(about.trial, data) if about.trial else None
        for number in about.episodes:
            one = episode(about.system, number)
            with Simulator(system.novice, one.heights, system.physics) as simulator:
                driver = _driver(about, model, simulator, one, number)
                rules = EpisodeRules(
                    simulator.reset(yaw=one.yaw), system.terrain.half_width
                )
                found = ride(simulator, driver, rules, about.longest)
            pace += driver.pace
            driven.append(_of_ride(found, one.goal))
            if number < KEPT:
                paths.append(found.path.tolist())
        loss, error = (
            _quality(model, about.trial, data) if model and about.trial else (0.0, 0.0)
        )
    return Driven(
        about=about,
        **by_field(driven),
        validation_loss=loss,
        position_error=error,
        plans=len(pace),
        plan_seconds=float(np.median(pace)) if pace else 0.0,
        slowest_plan_seconds=float(np.percentile(pace, 95)) if pace else 0.0,
        paths=tuple(paths),
        provenance=making.done(),
    )


def _of_ride(found: Ride, goal: np.ndarray) -> dict[str, Any]:
    """The fields on an episode."""
    names = ("ended", "seconds", "length", "top_speed", "steepest", "surprise")
    return {name: getattr(found, name) for name in names} | {
        "away": float(np.linalg.norm(goal)),
        "left": float(np.linalg.norm(found.path[-1] - goal)),
        "throttle": float(np.abs(found.actions[:, 0]).mean()),
    }


def _quality(model: Predictor, trial: Trial, data: str | Path) -> tuple[float, float]:
    """Validation loss of a model and its mean position error after 2.5 s, m, as the trial's row has them."""
    found = judge(model, trial, Library(data))
    return float(found.losses.sum()), float(found.position[-1])


def _driver(
    about: DriverTest,
    model: Predictor | None,
    simulator: Any,
    one: Episode,
    number: int,
) -> Driver:
    """The driver of an episode."""
    if about.planning is None:
        return Driver(one.goal)
    imagination = simulator
    if model and about.trial:
        imagination = Dreamer(
            model, one.heights, about.trial.network.pixels, about.planning.horizon
        )
    return Driver(one.goal, Planner(about.planning, one.goal, number), imagination)
