"""The motion of the family of robots around the paper's four."""

from __future__ import annotations

import hashlib
import re

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


def robots(wanted: Dataset) -> System | None:
    """The system of a family member's dataset; None for another dataset."""
    found = re.fullmatch(r"member(\d+)_\w+", wanted.collection.role)
    if found is None:
        return None
    return family_system(wanted.collection.system, int(found[1]))
