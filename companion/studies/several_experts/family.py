"""The motion of the family of robots around the paper's four."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from concurrent.futures import Executor
from pathlib import Path

from companion.engine.datasets import collect_dataset
from companion.trials import EXPERT_SEED, Dataset
from sidm.config import replace
from sidm.shards import Collection
from sidm.systems import System, family_robot, find_system


def family_system(system: str, number: int) -> System:
    """A system of the paper with a member of the family as the expert."""
    paper = find_system(system)
    return replace(paper, name=system, expert=family_robot(number))


def dataset(system: str, number: int, policy: str, count: int) -> Dataset:
    """The first `count` trajectories of a family member on a system's ground.

    Another robot, ground or physics makes another dataset.
    """
    pair = family_system(system, number)
    description = repr((pair.expert, pair.terrain, pair.physics))
    mark = hashlib.sha256(description.encode()).hexdigest()[:8]
    collection = Collection(
        system=system, role=f"member{number}_{mark}", policy=policy, seed=EXPERT_SEED
    )
    return Dataset(collection=collection, count=count)


def collect_members(
    system: str,
    policy: str,
    counts: Mapping[int, Iterable[int]],
    data: str | Path,
    executor: Executor,
) -> None:
    """Simulate the missing motion of family members.

    Args:
        system: name of the pair of robots whose ground it is.
        policy: exploration policy.
        counts: number of a member -> numbers of trajectories of its datasets.
        data: folder of motion.
        executor: runs the simulations.
    """
    for number, member_counts in counts.items():
        pair = family_system(system, number)
        for count in member_counts:
            wanted = dataset(system, number, policy, count)
            collect_dataset(wanted, data, executor, system=pair)
