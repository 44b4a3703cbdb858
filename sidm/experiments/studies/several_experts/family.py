"""A family of robots around the paper's four, and their motion."""

from __future__ import annotations

import functools
import hashlib
import math
from collections.abc import Iterable, Mapping
from concurrent.futures import Executor, as_completed
from pathlib import Path

import numpy as np

from sidm.experiments.engine.datasets import note_collected, note_digest
from sidm.experiments.trials import EXPERT_SEED, Dataset
from sidm.progress import progress_bar
from sidm.systems import Robot, System, find_system
from sidm.trajectory import DISCARDS, SHARD_SIZE, Collection, load, write_shard

FAMILY_SEED = 5  # of the robots drawn

#: Ranges that hold the paper's four robots, drawn from evenly in the logarithm or, where they reach 0, in the number.
LOGARITHMIC = {
    "throttle_scale": (30.0, 60.0),
    "steering_scale": (0.5, 0.8),
    "damping": (1.0, 100.0),
    "spring": (75.0, 50_000.0),
    "friction": (1.0, 1.25),
    "mass_scale": (1.0, 1.5),
}
LINEAR = {"spring_offset": (-0.002, 0.0), "travel_lower": (-0.02, -0.01), "travel_upper": (0.0, 0.003)}


def member(number: int) -> Robot:
    """Robot `number` of the family."""
    rng = np.random.default_rng(np.random.SeedSequence(FAMILY_SEED, spawn_key=(number,)))
    values = {
        name: math.exp(rng.uniform(math.log(low), math.log(high))) for name, (low, high) in LOGARITHMIC.items()
    }
    values |= {name: rng.uniform(low, high) for name, (low, high) in LINEAR.items()}
    return Robot(**{name: float(f"{value:.4g}") for name, value in values.items()})


def own_system(system: str, number: int) -> System:
    """A paper's system with a member of the family in the expert's place."""
    paper = find_system(system)
    return System(name=system, novice=paper.novice, expert=member(number), terrain=paper.terrain, physics=paper.physics)


def dataset(system: str, number: int, policy: str, count: int) -> Dataset:
    """The first `count` trajectories of a member on a system's ground; another robot, ground or physics is another."""
    own = own_system(system, number)
    mark = hashlib.sha256(repr((own.expert, own.terrain, own.physics)).encode()).hexdigest()[:8]
    role = f"member{number}_{mark}"
    return Dataset(collection=Collection(system=system, role=role, policy=policy, seed=EXPERT_SEED), count=count)


def collect_members(
    system: str,
    policy: str,
    counts: Mapping[int, Iterable[int]],
    data: str | Path,
    results: str | Path,
    executor: Executor,
    progress: bool = True,
) -> None:
    """Simulate what is missing of the members, by number, and note the digests of so many trajectories of each."""
    from sidm.simulation.collect import missing_shards

    data = Path(data).absolute()
    jobs = [
        (number, shard)
        for number, some in counts.items()
        for shard in missing_shards(data, dataset(system, number, policy, 1).collection, max(some))
    ]
    with progress_bar(len(jobs) * SHARD_SIZE, f"{system} family", "trajectory", progress) as bar:
        futures = [executor.submit(_make_shard, data, system, policy, *job) for job in jobs]
        for future in as_completed(futures):
            future.result()
            bar.update(SHARD_SIZE)
    for number, some in counts.items():
        for count in some:
            one = dataset(system, number, policy, count)
            note_digest(one, load(data, one.collection, count), data)
            note_collected(one, data, results)


@functools.lru_cache(maxsize=1)
def _simulator(system: System):
    from sidm.simulation import Simulator

    return Simulator(system.expert, np.zeros((system.terrain.size, system.terrain.size)), system.physics)


def _make_shard(data: Path, system: str, policy: str, number: int, shard: int) -> None:
    """Simulate and write one shard of a member; attempts and their ends are those of `sidm.simulation.collect`."""
    from sidm.simulation.collect import MOST_ATTEMPTS, attempt

    own, which, found = own_system(system, number), dataset(system, number, policy, 1).collection, []
    for index in range(SHARD_SIZE * shard, SHARD_SIZE * (shard + 1)):
        causes: list[str | None] = []
        for one in range(MOST_ATTEMPTS):
            trajectory, cause = attempt(_simulator(own), own, which, index, one)
            if trajectory is not None:
                found.append(trajectory._replace(discarded=tuple(causes.count(name) for name in DISCARDS)))
                break
            causes.append(cause)
        else:
            raise RuntimeError(f"{which}: {MOST_ATTEMPTS} attempts at trajectory {index} ended early; last: {cause}")
    write_shard(which.shard(data, shard), found)
