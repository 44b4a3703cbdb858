"""Simulated drives on disk: collections of immutable shards, without pickle.

A collection is interrupted and continued by any worker; a shard holds SHARD_SIZE
drives of it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sidm.body import ROVER
from sidm.config import ConfigError, DataError, config
from sidm.drives import STEPS, Drive, SimulatedGround
from sidm.storage import read_arrays, write_arrays
from sidm.systems import Terrain, find_system

SHARD_SIZE = 4  # trajectories in a shard
#: one trajectory of four is for testing: 75 % train, 25 % test (section 4)
TEST_EVERY = 4

#: Why an attempt at a trajectory is thrown away.
DISCARDS = ("stuck", "border", "rollover", "unstable")

#: Arrays of a shard that do not hold floats, and their types on disk.
TYPES: dict[str, Any] = {
    "index": np.int64,
    "terrain_seed": np.uint64,
    "terrain_checksum": "U16",
    "discarded": np.int64,
}
#: Arrays of a shard that describe the ground, in the order of `SimulatedGround`.
GROUND = ("terrain_seed", "terrain_checksum", "terrain_probe")


class ShardError(DataError):
    """A shard is missing, damaged or foreign; one line with the file and a remedy."""


def simulated_ground(drive: Drive) -> SimulatedGround:
    """The ground of a simulated drive."""
    if not isinstance(drive.ground, SimulatedGround):
        name = drive.name or "the drive"
        raise ValueError(f"{name} was not simulated: its ground has no seed")
    return drive.ground


def digest(drives: Iterable[Drive]) -> str:
    """16 hexadecimal digits that identify the content of simulated drives."""
    total = hashlib.sha256()
    for drive in drives:
        ground = simulated_ground(drive)
        total.update(f"{drive.index}{ground.seed}{ground.checksum}".encode())
        total.update(np.ascontiguousarray(drive.states).data)
        total.update(np.ascontiguousarray(drive.actions).data)
    return total.hexdigest()[:16]


def write_shard(path: Path, drives: Sequence[Drive]) -> None:
    """Write simulated drives of equal length as one immutable .npz file."""
    grounds = [simulated_ground(drive) for drive in drives]
    columns: dict[str, list] = {
        name: [getattr(drive, name) for drive in drives]
        for name in ("index", "states", "actions", "discarded")
    }
    for name in GROUND:
        field = name.removeprefix("terrain_")
        columns[name] = [getattr(ground, field) for ground in grounds]
    arrays = {name: np.array(rows, TYPES.get(name)) for name, rows in columns.items()}
    write_arrays(path, arrays)


def read_shard(path: Path, terrain: Terrain, robot: str = "") -> list[Drive]:
    """The drives of a shard: of `robot`, on that kind of ground."""
    try:
        columns = read_arrays(path)
        columns |= {name: columns[name].tolist() for name in TYPES}
        drives = []
        for row in range(len(columns["index"])):
            index, states, actions, discarded, *ground = (
                columns[name][row]
                for name in ("index", "states", "actions", "discarded", *GROUND)
            )
            where = SimulatedGround(terrain, *ground)
            motion = index, states, actions, where, tuple(discarded)
            drives.append(simulated_drive(robot, *motion))
        return drives
    except FileNotFoundError:
        raise ShardError(
            f"{path}: the shard is missing; collect again to make it"
        ) from None
    except (ValueError, KeyError, TypeError, IndexError) as error:
        raise ShardError(
            f"{path}: the shard is damaged ({error}); delete it and collect again"
        ) from None


def simulated_drive(
    robot: str,
    index: int,
    states: np.ndarray,
    actions: np.ndarray,
    ground: SimulatedGround,
    discarded: tuple = (),
) -> Drive:
    """Drive `index` of a simulated robot of this name, with a session of its own."""
    name = f"{robot} {index}".strip()
    return Drive(states, actions, ROVER, ground, name, robot, name, index, discarded)


def trajectories_for(minutes: float) -> int:
    """How many trajectories, of 64 steps of 0.1 s, make up `minutes`; at least 2."""
    return max(2, round(600 * minutes / STEPS))


@config
class Collection:
    """An endless sequence: trajectory i is a pure function of these values and i."""

    system: str  # name of the pair of robots, as in `systems.find_system`
    role: str  # 'novice' or 'expert'
    policy: str = "ornstein_uhlenbeck"  # name of the exploration policy
    #: differs between the novice's training data, the validation set and the expert's
    #: data, so that they have no trajectory in common
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse names that would lead out of the data folder."""
        for name in ("system", "role", "policy"):
            value = getattr(self, name)
            if not value.isidentifier():
                raise ConfigError(
                    f"Collection.{name} must be a plain name, not {value!r}"
                )
        if self.seed < 0:
            raise ConfigError(f"Collection.seed must not be negative, not {self.seed}")

    def folder(self, root: Path) -> Path:
        """The folder of its shards inside the data folder `root`."""
        return Path(root) / self.system / self.role / self.policy / f"seed-{self.seed}"

    def shard(self, root: Path, number: int) -> Path:
        """The file of a shard; its first trajectory is SHARD_SIZE * `number`."""
        return self.folder(root) / f"shard-{number:05d}.npz"


#: Trajectories of a collection: the first so many, or those of these indices.
Which = int | Sequence[int]


def load(
    root: Path, collection: Collection, which: Which, terrain: Terrain | None = None
) -> list[Drive]:
    """Drives of a collection in the data folder `root`, in the order of `which`.

    `terrain` is the kind of ground, by default that of the collection's system. A
    ShardError names the first shard that is missing or damaged.
    """
    terrain = find_system(collection.system).terrain if terrain is None else terrain
    robot = f"{collection.system} {collection.role}"
    drives: dict[int, Drive] = {}
    for number in shards_of(which):
        read = read_shard(collection.shard(root, number), terrain, robot)
        first = SHARD_SIZE * number
        if [drive.index for drive in read] != [*range(first, first + len(read))]:
            folder = collection.folder(root)
            raise ShardError(
                f"{folder}: shards out of order; delete the folder and collect again"
            )
        drives |= {drive.index: drive for drive in read}
    return [drives[index] for index in indices_of(which)]


def indices_of(which: Which) -> Sequence[int]:
    """Indices of trajectories."""
    return range(which) if isinstance(which, int) else which


def shards_of(which: Which) -> list[int]:
    """Numbers of the shards that hold trajectories, each once, in order."""
    return sorted({index // SHARD_SIZE for index in indices_of(which)})


def missing_shards(root: Path, collection: Collection, which: Which) -> list[int]:
    """Numbers of the shards of trajectories that are not on disk."""
    there = set(collection.folder(Path(root)).glob("shard-*.npz"))
    return [k for k in shards_of(which) if collection.shard(root, k) not in there]


def novice_split(
    pool_size: int, minutes: float, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Indices (n,) and (m,) of a pool's trajectories to train on and to test on.

    About 75 % of `minutes` of motion are for training, and there is at least one
    trajectory of each. With one seed, the trajectories chosen for fewer minutes are
    among those chosen for more, and in the same part. A pool that is too small is a
    ConfigError.
    """
    count = trajectories_for(minutes)
    if count > pool_size:
        raise ConfigError(
            f"{minutes:g} novice minutes are {count} trajectories, "
            f"but the pool has {pool_size}; collect a larger pool"
        )
    return split_indices(pool_size, count, seed)


def split_indices(
    pool_size: int, count: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Indices of `count` of `pool_size` trajectories, split as by `novice_split`."""
    chosen = np.random.default_rng(seed).permutation(pool_size)[:count]
    testing = np.arange(count) % TEST_EVERY == 1
    return chosen[~testing], chosen[testing]
