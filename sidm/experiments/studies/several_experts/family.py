"""The motion of the family of robots around the paper's four."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Iterable, Mapping
from concurrent.futures import Executor, as_completed
from pathlib import Path

import numpy as np

from sidm.experiments.engine.datasets import note_collected, note_digest
from sidm.experiments.trials import EXPERT_SEED, Dataset
from sidm.progress import progress_bar
from sidm.systems import System, find_system, member
from sidm.trajectory import DISCARDS, SHARD_SIZE, Collection, load, write_shard


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
