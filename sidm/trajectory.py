"""A trajectory and how it lies on disk: immutable shards without pickle.

The state of a robot, 13 numbers:

=====  ====================  ========  ==========================
index  quantity              unit      frame
=====  ====================  ========  ==========================
0-2    position              m         world
3-6    quaternion x,y,z,w    -         body to world
7-9    linear velocity       m/s       body
10-12  angular velocity      rad/s     body
=====  ====================  ========  ==========================

Body frame: x forward, y left, z up, origin at the chassis' centre of mass. An action is (throttle, steering), each in
[-1, 1]; a control step lasts 0.1 s.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sidm.config import ConfigError, Fault, config
from sidm.storage import read_arrays, write_arrays

POSITION, QUATERNION, TWIST = slice(0, 3), slice(3, 7), slice(7, 13)
STATE_SIZE, ACTION_SIZE = 13, 2
STEPS = 64  # control steps of a trajectory
CONTROL_STEP = 0.1  # s
SHARD_SIZE = 4  # trajectories in a shard

PROBES = 8
SPREAD = (0.618034, 0.754878)  # of a row's and a column's share of the ground to the next probe's: none are in line
SAME_HEIGHT = 1e-6  # m; processors differ by some 1e-14

#: Why an attempt at a trajectory is thrown away.
DISCARDS = ("stuck", "border", "rollover", "unstable")


class ShardError(Fault):
    """A shard that is missing, damaged or from elsewhere; the message is one line that names the file and the mend."""


def upright(states: Any) -> Any:
    """The cosine (...) of the tilt of states (..., 13), arrays or tensors; below 0 they are upside down."""
    x, y = states[..., QUATERNION][..., 0], states[..., QUATERNION][..., 1]
    return 1 - 2 * (x * x + y * y)


class Trajectory(NamedTuple):
    """T control steps of one robot on one terrain."""

    index: int  # type: ignore[assignment]  # within its collection
    states: np.ndarray  # (T + 1, 13) float32
    actions: np.ndarray  # (T, 2) float32
    terrain_seed: int  # generate_terrain(terrain, seed) makes its ground again
    terrain_checksum: str  # of the heights' bits where it was simulated; a part of the digest
    terrain_probe: np.ndarray  # (8,) m, `probe` of the heights, by which any machine knows the ground again
    discarded: tuple[int, ...]  # attempts thrown away before this one, by the causes in DISCARDS


#: Of the fields that are no arrays of floats, on disk.
TYPES: dict[str, Any] = {"index": np.int64, "terrain_seed": np.uint64, "terrain_checksum": "U16", "discarded": np.int64}


def checksum(array: np.ndarray) -> str:
    """16 hexadecimal digits that change when any byte, the shape or the type of `array` does."""
    digest = hashlib.sha256(f"{array.dtype.str}{array.shape}".encode())
    digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()[:16]


def probe(heights: np.ndarray) -> np.ndarray:
    """Heights (8,), m, at places spread over a ground (H, W)."""
    rows, columns = ((np.arange(1, PROBES + 1) * step % 1 * size).astype(int)
                     for step, size in zip(SPREAD, heights.shape, strict=True))  # fmt: skip
    return heights[rows, columns]


def is_ground_of(heights: np.ndarray, trajectory: Trajectory) -> bool:
    """Whether heights (H, W), m, are those that a trajectory drove on, but for rounding."""
    return np.allclose(probe(heights), trajectory.terrain_probe, rtol=0, atol=SAME_HEIGHT)


def digest(trajectories: Iterable[Trajectory]) -> str:
    """16 hexadecimal digits that stand for the content of a dataset."""
    total = hashlib.sha256()
    for trajectory in trajectories:
        total.update(f"{trajectory.index}{trajectory.terrain_seed}{trajectory.terrain_checksum}".encode())
        total.update(np.ascontiguousarray(trajectory.states).data)
        total.update(np.ascontiguousarray(trajectory.actions).data)
    return total.hexdigest()[:16]


def write_shard(path: Path, trajectories: Sequence[Trajectory]) -> None:
    """Write trajectories of equal length as one immutable .npz file."""
    columns = zip(Trajectory._fields, zip(*trajectories, strict=True), strict=True)
    write_arrays(path, {name: np.array(column, TYPES.get(name)) for name, column in columns})


def read_shard(path: Path) -> list[Trajectory]:
    """The trajectories of a shard; ShardError when the file is missing or damaged."""
    try:
        columns = read_arrays(path)
        _check_shapes(columns)
        fields = columns | {name: columns[name].tolist() for name in TYPES}
        fields["discarded"] = list(map(tuple, fields["discarded"]))
        return [Trajectory(*row) for row in zip(*(fields[name] for name in Trajectory._fields), strict=True)]
    except FileNotFoundError:
        raise ShardError(f"{path}: the shard is missing; collect again to make it") from None
    except (ValueError, KeyError, TypeError) as error:
        raise ShardError(f"{path}: the shard is damaged ({error}); delete it and collect again") from None


def _check_shapes(columns: Mapping[str, np.ndarray]) -> None:
    """ValueError or KeyError unless a shard's columns belong together."""
    count, steps = columns["actions"].shape[:2]
    wanted = {
        "index": (count,), "states": (count, steps + 1, STATE_SIZE), "actions": (count, steps, ACTION_SIZE),
        "terrain_seed": (count,), "terrain_checksum": (count,), "terrain_probe": (count, PROBES),
        "discarded": (count, len(DISCARDS)),
    }  # fmt: skip
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
    seed: int = 0  # disjoint for the novice pool, the validation set and the expert's data

    def __post_init__(self) -> None:
        """Refuse names that would lead out of the data folder."""
        for name in ("system", "role", "policy"):
            if not getattr(self, name).isidentifier():
                raise ConfigError(f"Collection.{name} must be a plain name, not {getattr(self, name)!r}")
        if self.seed < 0:
            raise ConfigError(f"Collection.seed must not be negative, not {self.seed}")

    def folder(self, root: Path) -> Path:
        """Where its shards lie under the data folder `root`."""
        return Path(root) / self.system / self.role / self.policy / f"seed-{self.seed}"

    def shard(self, root: Path, number: int) -> Path:
        """The shard of trajectories SHARD_SIZE * number to SHARD_SIZE * (number + 1) - 1."""
        return self.folder(root) / f"shard-{number:05d}.npz"


def load(root: Path, collection: Collection, count: int) -> list[Trajectory]:
    """The first `count` trajectories of a collection; ShardError names the first shard that is missing or damaged."""
    shards = range(-(-count // SHARD_SIZE))
    trajectories = [t for number in shards for t in read_shard(collection.shard(root, number))]
    if [t.index for t in trajectories] != list(range(len(trajectories))):
        raise ShardError(f"{collection.folder(root)}: shards out of order; delete the folder and collect again")
    return trajectories[:count]
