"""From drives to tensors: windows of equal length, their maps cached on disk, the nested novice split."""

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
from sidm.config import ConfigError, replace
from sidm.drives import Drive
from sidm.learning import observation
from sidm.shards import Collection, ShardError, digest, load, trajectories_for
from sidm.storage import locked, write_atomically
from sidm.systems import Terrain

AT_A_TIME = 64  # trajectories whose maps are in memory while they are made
#: one trajectory of four is for testing: 75 % train, 25 % test (section 4)
TEST_EVERY = 4
Indices = Tensor | np.ndarray | Sequence[int]


@dataclass(frozen=True, eq=False, repr=False)
class Windows:
    """N windows of T steps of one robot, as the networks see them.

    All windows that are stored, or some `rows`. Rows are copied when asked for, so that
    maps can stay in a file.

    Attributes:
        stored_inputs: (M, T, X) float32, raw units; X is 11 of the paper's body
        stored_targets: (M, T, Y) float32, raw units; Y is 13 of the paper's body
        stored_maps: (M, T, P, P) float16, m; P is 0 of a body without a map
        rows: (N,) int64, which of the stored; None: all, in order
    """

    stored_inputs: Tensor
    stored_targets: Tensor
    stored_maps: Tensor
    rows: Tensor | None = None

    def __len__(self) -> int:
        """N."""
        return len(self.stored_inputs if self.rows is None else self.rows)

    def __repr__(self) -> str:
        return f"Windows({len(self)} of {self.stored_inputs.shape[1]} steps)"

    @property
    def inputs(self) -> Tensor:
        """(N, T, X) float32, raw units."""
        return self._of(self.stored_inputs)

    @property
    def targets(self) -> Tensor:
        """(N, T, Y) float32, raw units."""
        return self._of(self.stored_targets)

    @property
    def maps(self) -> Tensor:
        """(N, T, P, P) float16, m."""
        return self._of(self.stored_maps)

    def _of(self, stored: Tensor) -> Tensor:
        return stored if self.rows is None else stored[self.rows]

    @property
    def places(self) -> Tensor:
        """(N,) int64, which of the stored windows these are."""
        return torch.arange(len(self)) if self.rows is None else self.rows

    def take(self, indices: Indices) -> Windows:
        """The windows of these indices, copied."""
        chosen = torch.as_tensor(indices, dtype=torch.long)
        chosen = chosen if self.rows is None else self.rows[chosen]
        return Windows(
            self.stored_inputs[chosen],
            self.stored_targets[chosen],
            self.stored_maps[chosen],
        )

    def subset(self, indices: Indices) -> Windows:
        """The windows of these indices, not copied."""
        chosen = torch.as_tensor(indices, dtype=torch.long)
        return replace(self, rows=chosen if self.rows is None else self.rows[chosen])

    def first(self, count: int) -> Windows:
        """The first `count` windows, or all where there are fewer, not copied."""
        if self.rows is not None:
            return replace(self, rows=self.rows[:count])
        return Windows(
            self.stored_inputs[:count],
            self.stored_targets[:count],
            self.stored_maps[:count],
        )

    def split(self, size: int) -> Iterator[Windows]:
        """All windows in order, at most `size` at a time; of some rows each part is copied when its turn comes."""
        if self.rows is not None:
            return (self.take(part) for part in torch.arange(len(self)).split(size))
        parts = zip(
            *(one.split(size) for one in (self.inputs, self.targets, self.maps)),
            strict=True,
        )
        return (Windows(*part) for part in parts)

    def to(self, device: torch.device | str) -> Windows:
        """A copy on a device."""
        return Windows(
            self.inputs.to(device), self.targets.to(device), self.maps.to(device)
        )


class Datasets(NamedTuple):
    """What a trial learns from and is judged by."""

    train: Windows  # the novice's, to learn from
    test: Windows  # the novice's, to stop by
    validation: Windows  # the novice's, to judge by
    expert: Windows | None = None


def windows_of(
    drives: Sequence[Drive], pixels: int, body: Body | None = None
) -> Windows:
    """Drives of equal length T as tensors, with maps of their ground.

    Args:
        drives: of one robot.
        pixels: P, a side of the maps where the body does not say how many.
        body: what the networks are to see of a robot of the paper; by default the
            drives' own body.

    Raises:
        GroundError: simulated ground that cannot be made again as it was; one line.
        ConfigError: the body sees a height map, and a drive has no ground.
        ValueError: no drives.
    """
    if not drives:
        raise ValueError("no drives to make windows of")
    body = body or drives[0].body
    pixels = body.pixels(pixels)
    if not pixels:
        return _windows(drives, None, body)
    return _windows(
        drives,
        torch.from_numpy(np.stack([_maps(drive, pixels, body) for drive in drives])),
        body,
    )


def load_windows(
    root: str | Path,
    collection: Collection,
    count: int,
    terrain: Terrain,
    pixels: int,
    body: Body = ROVER,
) -> Windows:
    """The first `count` drives of a collection as tensors, as `body` has them.

    Their maps are computed once, written beside the shards and read by memory map, so
    that processes share them: a step takes 96 bytes of memory, and 2 P^2 bytes of a
    file.

    Raises:
        ShardError: a shard is missing or damaged, or a terrain cannot be made again as
            it was; one line.
    """
    drives = load(Path(root), collection, count, terrain)
    pixels = body.pixels(pixels)
    shape = (len(drives), len(drives[0]), pixels, pixels)
    if not pixels:
        return _windows(drives, None, body)
    other = (
        ""
        if (body.map_size, body.pose) == (ROVER.map_size, ROVER.pose)
        else f"-{body.map_size:g}m-{body.pose}"
    )
    path = collection.folder(Path(root)) / f"maps-{pixels}{other}-{digest(drives)}.npy"
    with locked(path):
        if not path.exists():
            write_atomically(path, lambda file: _write_maps(file, shape, drives, body))
    try:
        maps = np.load(path, mmap_mode="c", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise ShardError(
            f"{path}: the maps are damaged ({error}); delete the file to make it anew"
        ) from None
    if maps.shape != shape or maps.dtype != np.float16:
        raise ShardError(
            f"{path}: maps {maps.shape} where {shape} were expected; delete the file to make it anew"
        )
    return _windows(drives, torch.from_numpy(maps), body)


def _write_maps(
    file, shape: tuple[int, ...], drives: Sequence[Drive], body: Body
) -> None:
    """Write an array (N, T, P, P), one drive after the other; each core makes maps of its own drives."""
    header = {
        "descr": np.lib.format.dtype_to_descr(np.dtype(np.float16)),
        "fortran_order": False,
        "shape": shape,
    }
    np.lib.format.write_array_header_1_0(file, header)
    cores = (
        len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count() or 1
    )
    with ThreadPoolExecutor(cores) as pool:
        for start in range(0, len(drives), AT_A_TIME):
            for maps in pool.map(
                lambda drive: _maps(drive, shape[-1], body),
                drives[start : start + AT_A_TIME],
            ):
                file.write(maps.data)


def _maps(drive: Drive, pixels: int, body: Body) -> np.ndarray:
    """(T, P, P) float16: the maps at the start of each step."""
    if drive.ground is None:
        raise ConfigError(
            f"{drive.name}: body '{body.name}' sees a height map, and the drive has no ground"
        )
    heights = drive.ground.heights
    states = _seen(
        drive.body,
        body,
        torch.from_numpy(drive.states[:-1]),
        torch.from_numpy(drive.actions),
    )[0]
    maps = observation.robot_centred_map(
        heights, states, pixels, body.map_size, drive.ground.spacing, body
    )
    return maps.numpy().astype(np.float16)


def _windows(drives: Sequence[Drive], maps: Tensor | None, body: Body) -> Windows:
    states, actions = stacked(drives)
    last = actions[:, -1:]  # stands behind the last step, where no action is
    states, actions = _seen(drives[0].body, body, states, torch.cat([actions, last], 1))
    return windows_from(body, states, actions[:, :-1], maps)


def stacked(drives: Sequence[Drive]) -> tuple[Tensor, Tensor]:
    """States (N, T + 1, S) and actions (N, T, A), float64, of drives of equal length."""
    states, actions = (
        [getattr(drive, name) for drive in drives] for name in ("states", "actions")
    )
    return torch.from_numpy(np.stack(states)).double(), torch.from_numpy(
        np.stack(actions)
    ).double()


def _seen(
    own: Body, body: Body, states: Tensor, actions: Tensor
) -> tuple[Tensor, Tensor]:
    """States and actions of a robot as another body has them; as they are where it is the robot's own."""
    return (
        (states, actions) if own == body else observation.seen_as(body, states, actions)
    )


def windows_from(
    body: Body, states: Tensor, actions: Tensor, maps: Tensor | None = None
) -> Windows:
    """States (N, T + 1, S) and actions (N, T, A) of a body as the networks see them, with maps (N, T, P, P) if any."""
    inputs = observation.encode_inputs(states[:, :-1], actions, body)
    targets = observation.transition(states[:, :-1], states[:, 1:], body)
    if maps is None:
        maps = torch.zeros(*actions.shape[:2], 0, 0, dtype=torch.float16)
    return Windows(inputs.float(), targets.float(), maps)


def novice_split(
    pool_size: int, minutes: float, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Which trajectories of the novice pool to learn from and which to test on.

    Of one seed, the trajectories of fewer minutes are among those of more, and in the
    same part.

    Args:
        pool_size: trajectories in the pool.
        minutes: of motion, train and test together.
        seed: of the choice.

    Returns:
        Indices (n,) of the training trajectories, about 75 %, and (m,) of the test
        ones; at least one each.

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
