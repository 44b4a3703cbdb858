"""Driving to a goal over unseen ground: planned on a learned model, on the simulator itself, or straight ahead.

`python -m sidm study driving` makes what is not stored of it in results/driving.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import torch
from torch import Tensor

from sidm.config import ConfigError, config
from sidm.experiments.drawing import CONTROL_STEP
from sidm.experiments.measure import one_thread
from sidm.experiments.methods import COMPARED
from sidm.experiments.models import predictor_of
from sidm.experiments.provenance import Provenance, source_hash
from sidm.experiments.records import Making, Records
from sidm.experiments.study import Study
from sidm.experiments.trials import Trial
from sidm.learning.model import Predictor
from sidm.learning.planning import Dreamer, Planner, Planning, straight
from sidm.systems import find_system
from sidm.terrain import generate_terrain
from sidm.trajectory import POSITION

DRIVEN = (*COMPARED, "corrected_averaged")  # whose models; the last is what needs least data here
SIZES = (1.0, 5.0, 60.0)  # of the novice's data that the models have learnt from, min
EPISODES, EPISODES_SIMULATED = 50, 10
GOAL_SEED = 4  # apart from the seeds of all data
NEAREST, FARTHEST = 5.0, 8.0  # of a goal from the start, m
ARRIVED = 0.5  # m from the goal
LONGEST = 20.0  # s of an episode
KEPT = 4  # the first episodes, whose paths are stored

Driver = Literal["model", "simulator", "straight"]


@config
class Drive:
    """Episodes with one driver."""

    system: str
    driver: Driver
    trial: Trial | None  # that the model is of; None for the other drivers
    planning: Planning | None  # None for the driver who does not plan
    episodes: tuple[int, ...]  # by their numbers
    longest: float  # s of an episode

    def __post_init__(self) -> None:
        """Refuse a drive without an episode."""
        if not self.episodes or min(self.episodes) < 0:
            raise ConfigError(f"Drive.episodes must be numbers from 0 on, not {self.episodes}")


@config
class Driven:
    """What came of it; E episodes."""

    about: Drive
    ended: tuple[str, ...]  # (E,) 'arrived', a cause of `trajectory.DISCARDS`, or 'time'
    seconds: tuple[float, ...]  # (E,) of driving until then
    length: tuple[float, ...]  # (E,) m, of the path
    away: tuple[float, ...]  # (E,) m, from the goal at the start
    left: tuple[float, ...]  # (E,) m, from the goal at the end
    plans_per_second: float  # median of single plans, on one thread; 0 where none is made
    paths: tuple[tuple[tuple[float, float], ...], ...]  # of the episodes below KEPT: x and y, m, at each control step
    source: str  # hash of the code
    provenance: Provenance

    @property
    def stale(self) -> bool:
        """Whether the code has changed since."""
        return self.source != source_hash("driving")


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


def drives(
    study: Study,
    system: str,
    sizes: Iterable[float] = SIZES,
    episodes: int = EPISODES,
    simulated: int = EPISODES_SIMULATED,
    longest: float = LONGEST,
) -> list[Drive]:
    """All that are compared on a system.

    Args:
        study: whose models; those of a method and size, one a seed, share the episodes out among them.
        system: whose novice and ground.
        sizes: of the models' data, min.
        episodes: of a method and size, and of the straight driver.
        simulated: of the planner in the simulator, the first of the same.
        longest: s of an episode.
    """

    def one(driver: Driver, planning: Planning | None, numbers: Iterable[int], trial: Trial | None = None) -> Drive:
        return Drive(
            system=system, driver=driver, trial=trial, planning=planning, episodes=tuple(numbers), longest=longest
        )

    trials = study.points(system, DRIVEN, sizes)
    seeds = study.preset.seeds
    models = [one("model", Planning(), range(t.seed, episodes, seeds), t) for t in trials if t.seed < episodes]
    return [*models, one("straight", None, range(episodes)), one("simulator", Planning(), range(simulated))]


Act = Callable[[np.ndarray], np.ndarray]  # what a driver does in a state (13,): an action (2,)


def drive(about: Drive, data: str | Path = "data") -> Driven:
    """Drive all episodes of one driver; ImportError without PyBullet, in one line."""
    from sidm.simulation import Simulator
    from sidm.simulation.collect import EpisodeRules

    making, system = Making("driving"), find_system(about.system)
    pace: list[float] = []
    found: list[tuple[str, np.ndarray, np.ndarray]] = []
    with one_thread():
        model = predictor_of(about.trial, data) if about.trial else None
        for number in about.episodes:
            one = episode(about.system, number)
            with Simulator(system.novice, one.heights, system.physics) as simulator:
                act = _driver(about, model, simulator, one, number, pace)
                rules = EpisodeRules(simulator.reset(yaw=one.yaw), system.terrain.half_width)
                found.append((*_ride(simulator, act, rules, one.goal, about.longest), one.goal))
    lengths = [float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()) for _, path, _ in found]
    left = [float(np.linalg.norm(path[-1] - goal)) for _, path, goal in found]
    return Driven(
        about=about,
        ended=tuple(cause for cause, _, _ in found),
        seconds=tuple(CONTROL_STEP * (len(path) - 1) for _, path, _ in found),
        length=tuple(lengths),
        away=tuple(float(np.linalg.norm(goal)) for _, _, goal in found),
        left=tuple(left),
        plans_per_second=float(1 / np.median(pace)) if pace else 0.0,
        paths=tuple(
            tuple((x, y) for x, y in path.tolist())
            for number, (_, path, _) in zip(about.episodes, found, strict=True)
            if number < KEPT
        ),
        **making.done(),
    )


def _ride(simulator: Any, act: Act, rules: Any, goal: np.ndarray, longest: float) -> tuple[str, np.ndarray]:
    """How an episode ends, and its path (K + 1, 2), m."""
    state = simulator.state
    path = [state[POSITION][:2]]
    for _ in range(round(longest / CONTROL_STEP)):
        state = simulator.step(act(state))
        path.append(state[POSITION][:2])
        if np.linalg.norm(path[-1] - goal) < ARRIVED:
            return "arrived", np.array(path)
        cause = rules.ended(state)
        if cause:
            return cause, np.array(path)
    return "time", np.array(path)


def _driver(
    about: Drive, model: Predictor | None, simulator: Any, one: Episode, number: int, pace: list[float]
) -> Act:
    """What acts; the seconds of each plan are added to `pace`."""
    if about.planning is None:
        return lambda state: straight(state, one.goal)
    planner = Planner(about.planning, one.goal, number)
    dreamer = Dreamer(model, one.heights, about.trial.network.pixels) if model and about.trial else None
    ready: list[Tensor] = []

    def act(state: np.ndarray) -> np.ndarray:
        if not ready:
            start = time.perf_counter()
            if dreamer:
                plan = planner.plan(lambda actions: dreamer.imagine(state, actions))
            else:
                plan = planner.plan(functools.partial(_simulate, simulator))
            pace.append(time.perf_counter() - start)
            ready.extend(plan[: planner.settings.replan])
        action = ready.pop(0).numpy()
        if dreamer:
            dreamer.observe(state, action)
        return action

    return act


def _simulate(simulator: Any, actions: Tensor) -> Tensor:
    """Where actions (N, H, 2) lead, tried out in the simulator one sequence after the other: (N, H + 1, 13)."""
    now = simulator.save()
    paths = []
    for sequence in actions.numpy():
        path = [simulator.restore(now)]
        for action in sequence:
            path.append(simulator.step(action))
        paths.append(np.array(path))
    simulator.restore(now)
    return torch.from_numpy(np.array(paths))


def stored(results: str | Path = "results") -> Records[Driven]:
    """Where the results are kept."""
    return Records(Driven, Path(results) / "driving", "python -m sidm study driving")
