"""The motion of the family of robots around the paper's four."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from concurrent.futures import Executor
from pathlib import Path

from companion.engine.datasets import note_collected, note_digest
from companion.trials import EXPERT_SEED, Dataset
from sidm.shards import Collection
from sidm.systems import System, find_system, member


def own_system(system: str, number: int) -> System:
    """A paper's system with a member of the family in the expert's place."""
    paper = find_system(system)
    return System(
        name=system,
        novice=paper.novice,
        expert=member(number),
        terrain=paper.terrain,
        physics=paper.physics,
    )


def dataset(system: str, number: int, policy: str, count: int) -> Dataset:
    """The first `count` trajectories of a member on a system's ground; another robot, ground or physics is another."""
    own = own_system(system, number)
    mark = hashlib.sha256(
        repr((own.expert, own.terrain, own.physics)).encode()
    ).hexdigest()[:8]
    role = f"member{number}_{mark}"
    return Dataset(
        collection=Collection(
            system=system, role=role, policy=policy, seed=EXPERT_SEED
        ),
        count=count,
    )


def collect_members(
    system: str,
    policy: str,
    counts: Mapping[int, Iterable[int]],
    data: str | Path,
    results: str | Path,
    executor: Executor,
) -> None:
    """Simulate what is missing of the members, by number, and note the digests of so many trajectories of each."""
    from sidm.simulation import collect

    for number, some in counts.items():
        for count in some:
            one = dataset(system, number, policy, count)
            own = own_system(system, number)
            note_digest(
                one,
                collect(data, one.collection, count, executor=executor, system=own),
                data,
            )
            note_collected(one, data, results)
