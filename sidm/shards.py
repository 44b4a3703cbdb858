"""Simulated drives on disk: immutable shards without pickle, of collections that any worker can go on with."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sidm.body import ROVER
from sidm.config import ConfigError, Fault, config
from sidm.drives import ACTION_SIZE, PROBES, STATE_SIZE, STEPS, Drive, SimulatedGround
from sidm.storage import read_arrays, write_arrays
from sidm.systems import Terrain, find_system

SHARD_SIZE = 4  # trajectories in a shard

#: Why an attempt at a trajectory is thrown away.
DISCARDS = ("stuck", "border", "rollover", "unstable")


class ShardError(Fault):
    """A shard that is missing, damaged or from elsewhere; the message is one line that names the file and the mend."""


#: Members of a shard that are no arrays of floats, and their types on disk.
TYPES: dict[str, Any] = {
    "index": np.int64,
    "terrain_seed": np.uint64,
    "terrain_checksum": "U16",
    "discarded": np.int64,
}


def simulated_ground(drive: Drive) -> SimulatedGround:
    """The ground of a simulated drive; ValueError for one that was recorded."""
    if not isinstance(drive.ground, SimulatedGround):
        raise ValueError(
            f"{drive.name or 'the drive'} was not simulated: its ground has no seed"
        )
    return drive.ground


def digest(drives: Iterable[Drive]) -> str:
    """16 hexadecimal digits that stand for the content of a dataset of simulated drives."""
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
        "index": [drive.index for drive in drives],
        "states": [drive.states for drive in drives],
        "actions": [drive.actions for drive in drives],
        "terrain_seed": [ground.seed for ground in grounds],
        "terrain_checksum": [ground.checksum for ground in grounds],
        "terrain_probe": [ground.probe for ground in grounds],
        "discarded": [drive.discarded for drive in drives],
    }
    write_arrays(
        path,
        {name: np.array(column, TYPES.get(name)) for name, column in columns.items()},
    )


def read_shard(path: Path, terrain: Terrain, robot: str = "") -> list[Drive]:
    """The drives of a shard, over ground of a kind of `terrain`, by a `robot` of that name.

    Raises:
        ShardError: the file is missing or damaged.
    """
    try:
        columns = read_arrays(path)
        _check_shapes(columns)
        plain = {name: columns[name].tolist() for name in TYPES}
    except FileNotFoundError:
        raise ShardError(
            f"{path}: the shard is missing; collect again to make it"
        ) from None
    except (ValueError, KeyError, TypeError) as error:
        raise ShardError(
            f"{path}: the shard is damaged ({error}); delete it and collect again"
        ) from None
    seeds, checksums, probes = (
        plain["terrain_seed"],
        plain["terrain_checksum"],
        columns["terrain_probe"],
    )
    grounds = [
        SimulatedGround(terrain, *own)
        for own in zip(seeds, checksums, probes, strict=True)
    ]
    return [
        simulated_drive(
            robot,
            index,
            columns["states"][number],
            columns["actions"][number],
            grounds[number],
            tuple(plain["discarded"][number]),
        )
        for number, index in enumerate(plain["index"])
    ]


def simulated_drive(
    robot: str,
    index: int,
    states: np.ndarray,
    actions: np.ndarray,
    ground: SimulatedGround,
    discarded: tuple = (),
) -> Drive:
    """Drive `index` of a simulated robot of this name; each is a session of its own."""
    name = f"{robot} {index}".strip()
    return Drive(states, actions, ROVER, ground, name, robot, name, index, discarded)


def _check_shapes(columns: Mapping[str, np.ndarray]) -> None:
    """ValueError or KeyError unless a shard's columns belong together."""
    count, steps = columns["actions"].shape[:2]
    wanted = {
        "index": (count,),
        "states": (count, steps + 1, STATE_SIZE),
        "actions": (count, steps, ACTION_SIZE),
        "terrain_seed": (count,),
        "terrain_checksum": (count,),
        "terrain_probe": (count, PROBES),
        "discarded": (count, len(DISCARDS)),
    }
    for name, shape in wanted.items():
        if columns[name].shape != shape:
            raise ValueError(f"{name} has shape {columns[name].shape}, not {shape}")


def trajectories_for(minutes: float) -> int:
    """How many trajectories of 64 steps of 0.1 s make `minutes` of motion: at least 2."""
    return max(2, round(600 * minutes / STEPS))


@config
class Collection:
    """A named, endless sequence of trajectories: number i is a pure function of these values and of i."""

    system: str
    role: str
    policy: str = "ornstein_uhlenbeck"
    #: disjoint for the novice pool, the validation set and the expert's data
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse names that would lead out of the data folder."""
        for name in ("system", "role", "policy"):
            if not getattr(self, name).isidentifier():
                raise ConfigError(
                    f"Collection.{name} must be a plain name, not {getattr(self, name)!r}"
                )
        if self.seed < 0:
            raise ConfigError(f"Collection.seed must not be negative, not {self.seed}")

    def folder(self, root: Path) -> Path:
        """Where its shards lie under the data folder `root`."""
        return Path(root) / self.system / self.role / self.policy / f"seed-{self.seed}"

    def shard(self, root: Path, number: int) -> Path:
        """The shard of trajectories SHARD_SIZE * number to SHARD_SIZE * (number + 1) - 1."""
        return self.folder(root) / f"shard-{number:05d}.npz"


def load(
    root: Path, collection: Collection, count: int, terrain: Terrain | None = None
) -> list[Drive]:
    """The first `count` drives of a collection.

    Args:
        root: the data folder.
        collection: what is loaded.
        count: drives.
        terrain: the kind of ground; by default that of the system of the collection's
            name.

    Raises:
        ConfigError: no system of that name is known.
        ShardError: the first shard that is missing or damaged.
    """
    terrain = find_system(collection.system).terrain if terrain is None else terrain
    shards, robot = (
        range(-(-count // SHARD_SIZE)),
        f"{collection.system} {collection.role}",
    )
    drives = [
        drive
        for number in shards
        for drive in read_shard(collection.shard(root, number), terrain, robot)
    ]
    if [drive.index for drive in drives] != list(range(len(drives))):
        raise ShardError(
            f"{collection.folder(root)}: shards out of order; delete the folder and collect again"
        )
    return drives[:count]
