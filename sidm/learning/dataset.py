"""From trajectories to tensors: maps cached on disk, the nested novice split, standardisation, random batches."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from sidm.config import ConfigError
from sidm.learning import observation
from sidm.storage import write_atomically
from sidm.systems import Terrain
from sidm.terrain import generate_terrain
from sidm.trajectory import (
    Collection,
    ShardError,
    Trajectory,
    digest,
    is_ground_of,
    load,
    trajectories_for,
)

TEST_EVERY = 4  # one trajectory of four is for testing: 75 % train, 25 % test (section 4)
Indices = Tensor | np.ndarray | Sequence[int]

SMALLEST_STD = 1e-6  # of a component that changes; one that does not keeps its raw unit


@dataclass(frozen=True, eq=False)
class Motion:
    """N trajectories of T steps as the networks see them."""

    inputs: Tensor  # (N, T, 11) float32, raw units
    targets: Tensor  # (N, T, 13) float32, raw units
    maps: Tensor  # (N, T, P, P) float16, m

    def __len__(self) -> int:
        """N."""
        return len(self.inputs)

    def take(self, indices: Indices) -> Motion:
        """The trajectories of these indices, copied."""
        chosen = torch.as_tensor(indices, dtype=torch.long)
        return Motion(self.inputs[chosen], self.targets[chosen], self.maps[chosen])

    def part(self, indices: Indices) -> Part:
        """The trajectories of these indices, not copied."""
        return Part(self, torch.as_tensor(indices, dtype=torch.long))

    def first(self, count: int) -> Motion:
        """The first `count` trajectories, or all where there are fewer, not copied."""
        return Motion(self.inputs[:count], self.targets[:count], self.maps[:count])

    def split(self, size: int) -> Iterator[Motion]:
        """All trajectories in order, at most `size` at a time, not copied."""
        parts = zip(self.inputs.split(size), self.targets.split(size), self.maps.split(size), strict=True)
        return (Motion(*part) for part in parts)

    def to(self, device: torch.device | str) -> Motion:
        """The same on a device."""
        return Motion(self.inputs.to(device), self.targets.to(device), self.maps.to(device))


@dataclass(frozen=True, eq=False)
class Part:
    """Some trajectories of a Motion, by index: their maps stay in its file until they are taken."""

    whole: Motion
    indices: Tensor  # (N,) int64

    def __len__(self) -> int:
        """N."""
        return len(self.indices)

    @property
    def inputs(self) -> Tensor:
        """(N, T, 11) float32, raw units."""
        return self.whole.inputs[self.indices]

    @property
    def targets(self) -> Tensor:
        """(N, T, 13) float32, raw units."""
        return self.whole.targets[self.indices]

    def take(self, indices: Indices) -> Motion:
        """The trajectories of these indices within the part, copied."""
        return self.whole.take(self.indices[torch.as_tensor(indices, dtype=torch.long)])

    def first(self, count: int) -> Part:
        """The first `count` trajectories, or all where there are fewer."""
        return Part(self.whole, self.indices[:count])

    def split(self, size: int) -> Iterator[Motion]:
        """All trajectories in order, at most `size` at a time, each copied when its turn comes."""
        return (self.whole.take(indices) for indices in self.indices.split(size))


class Datasets(NamedTuple):
    """What a trial learns from and is judged by."""

    train: Motion | Part  # the novice's, to learn from
    test: Motion | Part  # the novice's, to stop by
    validation: Motion  # the novice's, to judge by
    expert: Motion | None = None


class Standardisation(NamedTuple):
    """Units in which the networks work: (raw - mean) / std."""

    input_mean: Tensor  # (11,) float32
    input_std: Tensor  # (11,)
    map_mean: Tensor  # (), m
    map_std: Tensor  # (), m
    target_mean: Tensor  # (13,)
    target_std: Tensor  # (13,)

    @classmethod
    def none(cls) -> Standardisation:
        """Raw units."""
        zeros, ones = torch.zeros, torch.ones
        x, y = observation.INPUT_SIZE, observation.TARGET_SIZE
        return cls(zeros(x), ones(x), zeros(()), ones(()), zeros(y), ones(y))

    @classmethod
    def of(cls, motion: Motion, maps_from: int = 256) -> Standardisation:
        """Mean and standard deviation over the steps of `motion`, the expert's; maps: of its first `maps_from`."""
        input_mean, input_std = _moments([motion.inputs.flatten(0, 1)])
        map_mean, map_std = _moments(maps.reshape(-1, 1) for maps in motion.maps[:maps_from])
        target_mean, target_std = _moments([motion.targets.flatten(0, 1)])
        return cls(input_mean, input_std, map_mean[0], map_std[0], target_mean, target_std)


def _moments(parts: Iterable[Tensor]) -> tuple[Tensor, Tensor]:
    """Mean and standard deviation (K,), float32, of the rows of all `parts`, each (., K)."""
    count, total, squares = 0, torch.zeros(()), torch.zeros(())
    for part in parts:
        wide = part.double()
        count, total, squares = count + len(wide), total + wide.sum(0), squares + wide.square().sum(0)
    mean = total / count
    std = (squares / count - mean.square()).clamp_min(0).sqrt()
    return mean.float(), torch.where(std > SMALLEST_STD, std, 1.0).float()


def prepare(trajectories: Sequence[Trajectory], terrain: Terrain, pixels: int) -> Motion:
    """Trajectories of equal length T as tensors, with maps of `pixels` a side.

    Raises:
        ShardError: a terrain that cannot be made again as it was; one line.
        ValueError: no trajectories.
    """
    maps = np.stack([_maps(trajectory, terrain, pixels) for trajectory in _some(trajectories)])
    return _motion(trajectories, torch.from_numpy(maps))


def load_motion(root: str | Path, collection: Collection, count: int, terrain: Terrain, pixels: int) -> Motion:
    """The first `count` trajectories of a collection as tensors.

    Their maps are computed once, written beside the shards and read by memory map, so that processes share them: a step
    takes 96 bytes of memory, and 2 P^2 bytes of a file.

    Raises:
        ShardError: a shard is missing or damaged, or a terrain cannot be made again as it was; one line.
    """
    trajectories = _some(load(Path(root), collection, count))
    path = collection.folder(Path(root)) / f"maps-{pixels}-{digest(trajectories)}.npy"
    shape = (len(trajectories), len(trajectories[0].actions), pixels, pixels)
    if not path.exists():
        write_atomically(path, lambda file: _write_maps(file, shape, trajectories, terrain))
    try:
        maps = np.load(path, mmap_mode="c", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise ShardError(f"{path}: the maps are damaged ({error}); delete the file to make it anew") from None
    if maps.shape != shape or maps.dtype != np.float16:
        raise ShardError(f"{path}: maps {maps.shape} where {shape} were expected; delete the file to make it anew")
    return _motion(trajectories, torch.from_numpy(maps))


def _some(trajectories: Sequence[Trajectory]) -> Sequence[Trajectory]:
    if not trajectories:
        raise ValueError("at least one trajectory is needed, not none")
    return trajectories


def _write_maps(file, shape: tuple[int, ...], trajectories: Sequence[Trajectory], terrain: Terrain) -> None:
    """Write an array (N, T, P, P), one trajectory after the other."""
    header = {"descr": np.lib.format.dtype_to_descr(np.dtype(np.float16)), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, header)
    for trajectory in trajectories:
        file.write(_maps(trajectory, terrain, shape[-1]).data)


def _maps(trajectory: Trajectory, terrain: Terrain, pixels: int) -> np.ndarray:
    """(T, P, P) float16: the maps at the start of each step."""
    heights = generate_terrain(terrain, trajectory.terrain_seed)
    if not is_ground_of(heights, trajectory):
        raise ShardError(
            f"trajectory {trajectory.index}: terrain {trajectory.terrain_seed} is no longer the one it drove on; "
            "delete the collection's folder and collect again"
        )
    maps = observation.robot_centred_map(heights, trajectory.states[:-1], pixels, spacing=terrain.spacing)
    return maps.numpy().astype(np.float16)


def _motion(trajectories: Sequence[Trajectory], maps: Tensor) -> Motion:
    states = torch.from_numpy(np.stack([t.states for t in trajectories])).double()  # (N, T + 1, 13)
    actions = torch.from_numpy(np.stack([t.actions for t in trajectories])).double()  # (N, T, 2)
    inputs = observation.encode_inputs(states[:, :-1], actions)
    targets = observation.transition(states[:, :-1], states[:, 1:])
    return Motion(inputs.float(), targets.float(), maps)


def novice_split(pool_size: int, minutes: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Which trajectories of the novice pool to learn from and which to test on.

    Of one seed, the trajectories of fewer minutes are among those of more, and in the same part.

    Args:
        pool_size: trajectories in the pool.
        minutes: of motion, train and test together.
        seed: of the choice.

    Returns:
        Indices (n,) of the training trajectories, about 75 %, and (m,) of the test ones; at least one each.

    Raises:
        ConfigError: the pool is too small.
    """
    count = trajectories_for(minutes)
    if count > pool_size:
        raise ConfigError(
            f"{minutes:g} novice minutes are {count} trajectories, but the pool has {pool_size}; collect a larger pool"
        )
    return split(pool_size, count, seed)


def split(pool_size: int, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Indices of `count` of `pool_size` trajectories in two parts (n,) and (m,), as `novice_split` gives them."""
    chosen = np.random.default_rng(seed).permutation(pool_size)[:count]
    testing = np.arange(count) % TEST_EVERY == 1
    return chosen[~testing], chosen[testing]
