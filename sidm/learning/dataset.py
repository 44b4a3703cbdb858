"""From trajectories to tensors: maps cached on disk, the nested novice split."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from sidm.body import ROVER, Body
from sidm.config import ConfigError
from sidm.learning import observation
from sidm.storage import locked, write_atomically
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

AT_A_TIME = 64  # trajectories whose maps are in memory while they are made
TEST_EVERY = 4  # one trajectory of four is for testing: 75 % train, 25 % test (section 4)
Indices = Tensor | np.ndarray | Sequence[int]


@dataclass(frozen=True, eq=False)
class Motion:
    """N trajectories of T steps as the networks see them."""

    inputs: Tensor  # (N, T, X) float32, raw units; X is 11 of the paper's body
    targets: Tensor  # (N, T, Y) float32, raw units; Y is 13 of the paper's body
    maps: Tensor  # (N, T, P, P) float16, m; P is 0 of a body without a map

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
        """(N, T, X) float32, raw units."""
        return self.whole.inputs[self.indices]

    @property
    def targets(self) -> Tensor:
        """(N, T, Y) float32, raw units."""
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
    validation: Motion | Part  # the novice's, to judge by
    expert: Motion | None = None


def prepare(trajectories: Sequence[Trajectory], terrain: Terrain, pixels: int, body: Body = ROVER) -> Motion:
    """Trajectories of equal length T as tensors, as `body` has them, with maps of `pixels` a side unless it says.

    Raises:
        ShardError: a terrain that cannot be made again as it was; one line.
        ValueError: no trajectories.
    """
    pixels = body.pixels(pixels)
    maps = np.stack([_maps(trajectory, terrain, pixels, body) for trajectory in trajectories])
    return _motion(trajectories, torch.from_numpy(maps), body)


def load_motion(
    root: str | Path, collection: Collection, count: int, terrain: Terrain, pixels: int, body: Body = ROVER
) -> Motion:
    """The first `count` trajectories of a collection as tensors, as `body` has them.

    Their maps are computed once, written beside the shards and read by memory map, so that processes share them: a step
    takes 96 bytes of memory, and 2 P^2 bytes of a file.

    Raises:
        ShardError: a shard is missing or damaged, or a terrain cannot be made again as it was; one line.
    """
    trajectories = load(Path(root), collection, count)
    pixels = body.pixels(pixels)
    shape = (len(trajectories), len(trajectories[0].actions), pixels, pixels)
    if not pixels:
        return _motion(trajectories, torch.zeros(shape, dtype=torch.float16), body)
    other = "" if (body.map_size, body.pose) == (ROVER.map_size, ROVER.pose) else f"-{body.map_size:g}m-{body.pose}"
    path = collection.folder(Path(root)) / f"maps-{pixels}{other}-{digest(trajectories)}.npy"
    with locked(path):
        if not path.exists():
            write_atomically(path, lambda file: _write_maps(file, shape, trajectories, terrain, body))
    try:
        maps = np.load(path, mmap_mode="c", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise ShardError(f"{path}: the maps are damaged ({error}); delete the file to make it anew") from None
    if maps.shape != shape or maps.dtype != np.float16:
        raise ShardError(f"{path}: maps {maps.shape} where {shape} were expected; delete the file to make it anew")
    return _motion(trajectories, torch.from_numpy(maps), body)


def _write_maps(
    file, shape: tuple[int, ...], trajectories: Sequence[Trajectory], terrain: Terrain, body: Body
) -> None:
    """Write an array (N, T, P, P), one trajectory after the other; each core makes maps of its own trajectories."""
    header = {"descr": np.lib.format.dtype_to_descr(np.dtype(np.float16)), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, header)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with ThreadPoolExecutor(cores) as pool:
        for start in range(0, len(trajectories), AT_A_TIME):
            some = trajectories[start : start + AT_A_TIME]
            for maps in pool.map(lambda one: _maps(one, terrain, shape[-1], body), some):
                file.write(maps.data)


def _maps(trajectory: Trajectory, terrain: Terrain, pixels: int, body: Body) -> np.ndarray:
    """(T, P, P) float16: the maps at the start of each step."""
    heights = generate_terrain(terrain, trajectory.terrain_seed)
    if not is_ground_of(heights, trajectory):
        raise ShardError(
            f"trajectory {trajectory.index}: terrain {trajectory.terrain_seed} is no longer the one it drove on; "
            "delete the collection's folder and collect again"
        )
    states, _ = observation.seen_as(body, *map(torch.from_numpy, (trajectory.states[:-1], trajectory.actions)))
    maps = observation.robot_centred_map(heights, states, pixels, body.map_size, terrain.spacing, body)
    return maps.numpy().astype(np.float16)


def _motion(trajectories: Sequence[Trajectory], maps: Tensor, body: Body) -> Motion:
    states = torch.from_numpy(np.stack([t.states for t in trajectories])).double()  # (N, T + 1, 13)
    actions = torch.from_numpy(np.stack([t.actions for t in trajectories])).double()  # (N, T, 2)
    last = actions[:, -1:]  # stands behind the last step, where no action is
    states, actions = observation.seen_as(body, states, torch.cat([actions, last], 1))
    return motion_of(body, states, actions[:, :-1], maps)


def motion_of(body: Body, states: Tensor, actions: Tensor, maps: Tensor | None = None) -> Motion:
    """States (N, T + 1, S) and actions (N, T, A) of a body as the networks see them, with maps (N, T, P, P) if any."""
    inputs = observation.encode_inputs(states[:, :-1], actions, body)
    targets = observation.transition(states[:, :-1], states[:, 1:], body)
    if maps is None:
        maps = torch.zeros(*actions.shape[:2], 0, 0, dtype=torch.float16)
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
