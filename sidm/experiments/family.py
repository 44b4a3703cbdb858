"""A family of robots around the paper's four, and their motion."""

from __future__ import annotations

import functools
import math
from concurrent.futures import Executor, as_completed
from pathlib import Path

import numpy as np

from sidm.experiments.trials import EXPERT_SEED
from sidm.progress import progress_bar
from sidm.systems import SYSTEMS, Robot, System
from sidm.trajectory import SHARD_SIZE, Collection, Trajectory, load, write_shard

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


def collection(system: str, number: int, policy: str) -> Collection:
    """What a member's motion on a system's ground is called; it has the place of an expert's."""
    return Collection(system=system, role=f"member{number}", policy=policy, seed=EXPERT_SEED)


def collect_members(
    system: str,
    policy: str,
    counts: dict[int, int],
    data: str | Path,
    executor: Executor,
    progress: bool = True,
) -> None:
    """Simulate what is missing of so many trajectories of each member."""
    from sidm.simulation.collect import missing_shards

    data = Path(data).absolute()
    jobs = [
        (number, shard)
        for number, count in counts.items()
        for shard in missing_shards(data, collection(system, number, policy), count)
    ]
    with progress_bar(len(jobs) * SHARD_SIZE, f"{system} family", "trajectory", progress) as bar:
        futures = [executor.submit(_make_shard, data, system, policy, *job) for job in jobs]
        for future in as_completed(futures):
            future.result()
            bar.update(SHARD_SIZE)


def member_trajectories(system: str, number: int, policy: str, count: int, data: str | Path) -> list[Trajectory]:
    """The first `count` of a member; ShardError names what is missing."""
    return load(Path(data), collection(system, number, policy), count)


@functools.lru_cache(maxsize=1)
def _simulator(system: System):
    from sidm.simulation import Simulator

    return Simulator(system.expert, np.zeros((system.terrain.size, system.terrain.size)), system.physics)


def _make_shard(data: Path, system: str, policy: str, number: int, shard: int) -> None:
    """Simulate and write one shard of a member, as `sidm.simulation.collect` does it for the paper's robots."""
    from sidm.simulation.collect import MOST_ATTEMPTS, attempt

    paper = SYSTEMS[system]
    own = System(name=system, novice=paper.novice, expert=member(number), terrain=paper.terrain, physics=paper.physics)
    which, found = collection(system, number, policy), []
    for index in range(SHARD_SIZE * shard, SHARD_SIZE * (shard + 1)):
        tries = (attempt(_simulator(own), own, which, index, one) for one in range(MOST_ATTEMPTS))
        made = next((trajectory for trajectory, _ in tries if trajectory is not None), None)
        if made is None:
            raise RuntimeError(f"{which}: {MOST_ATTEMPTS} attempts at trajectory {index} ended early")
        found.append(made._replace(discarded=(0, 0, 0, 0)))
    write_shard(which.shard(data, shard), found)
