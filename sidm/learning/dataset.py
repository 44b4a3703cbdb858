"""From drives to tensors: windows of equal length, and the novice's nested split."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np
import torch
from torch import Tensor

from sidm.body import ROVER, Body
from sidm.config import ConfigError, replace
from sidm.drives import Drive
from sidm.learning import observation
from sidm.shards import Collection, ShardError, Which, digest, load
from sidm.storage import locked, write_atomically
from sidm.systems import Terrain

MAPS_AT_A_TIME = 64  # drives whose maps are in memory while a file is written

Indices = Tensor | np.ndarray | Sequence[int]


@dataclass(frozen=True, eq=False, repr=False)
class Windows:
    """N windows of T steps of one robot, as the networks see them.

    Rows are copied when they are asked for, so that maps can stay in a file.
    """

    stored_inputs: Tensor  # (M, T, X) float32, raw units; X is 11 for the paper's body
    stored_targets: Tensor  # (M, T, Y) float32, raw units; Y is 13 for the paper's body
    stored_maps: Tensor  # (M, T, P, P) float16, m; P is 0 for a body without a map
    #: (N,) int64, the chosen rows of the stored tensors; None: all, in order
    rows: Tensor | None = None

    def __len__(self) -> int:
        """Number of windows."""
        return len(self.stored_inputs if self.rows is None else self.rows)

    def __repr__(self) -> str:
        return f"Windows({len(self)} of {self.stored_inputs.shape[1]} steps)"

    @property
    def inputs(self) -> Tensor:
        """Inputs (N, T, X), float32, in raw units."""
        return self._chosen(self.stored_inputs)

    @property
    def targets(self) -> Tensor:
        """Transitions (N, T, Y), float32, in raw units."""
        return self._chosen(self.stored_targets)

    @property
    def maps(self) -> Tensor:
        """Height maps (N, T, P, P), float16, in m."""
        return self._chosen(self.stored_maps)

    @property
    def row_indices(self) -> Tensor:
        """The rows (N,), int64, of these windows in the stored tensors."""
        return torch.arange(len(self)) if self.rows is None else self.rows

    def take(self, indices: Indices) -> Windows:
        """The windows at `indices`, copied."""
        part = self.subset(indices)
        return Windows(*map(part._chosen, self._stored))

    def subset(self, indices: Indices) -> Windows:
        """The windows at `indices`, not copied."""
        chosen = torch.as_tensor(indices, dtype=torch.long)
        rows = chosen if self.rows is None else self.rows[chosen]
        return replace(self, rows=rows)

    def first(self, count: int) -> Windows:
        """The first `count` windows, or all where there are fewer, not copied."""
        if self.rows is not None:
            return replace(self, rows=self.rows[:count])
        return Windows(*(stored[:count] for stored in self._stored))

    def split(self, size: int) -> Iterator[Windows]:
        """All windows in order, in parts of at most `size`; chosen rows are copied."""
        if self.rows is not None:
            return (self.take(part) for part in torch.arange(len(self)).split(size))
        parts = zip(*(stored.split(size) for stored in self._stored), strict=True)
        return (Windows(*part) for part in parts)

    def to(self, device: torch.device | str) -> Windows:
        """A copy on a device."""
        return Windows(*(self._chosen(stored).to(device) for stored in self._stored))

    @property
    def _stored(self) -> tuple[Tensor, Tensor, Tensor]:
        """Inputs, targets and maps of all rows."""
        return self.stored_inputs, self.stored_targets, self.stored_maps

    def _chosen(self, stored: Tensor) -> Tensor:
        """The chosen rows of a stored tensor."""
        return stored if self.rows is None else stored[self.rows]


class Datasets(NamedTuple):
    """The data that a model learns from and is evaluated on."""

    train: Windows  # the novice's, to learn from
    test: Windows  # the novice's, to stop training by
    validation: Windows  # the novice's, to evaluate the trained model on
    expert: Windows | None = None  # to learn from


def windows_of(
    drives: Sequence[Drive], pixels: int, body: Body | None = None
) -> Windows:
    """Drives of equal length T as tensors, with maps of their ground.

    Args:
        drives: of one robot.
        pixels: P, pixels along a side of the maps, unless the body gives this number.
        body: what the networks see of one of the paper's robots; by default the
            drives' own body.

    Raises:
        GroundError: simulated ground that cannot be made again as it was.
        ConfigError: the body sees a height map, and a drive has no ground.
        ValueError: no drives.
    """
    if not drives:
        raise ValueError("no drives to make windows of")
    body = body or drives[0].body
    pixels = body.pixels(pixels)
    if not pixels:
        return _encode_drives(drives, body)
    maps = np.stack([drive_maps(drive, pixels, body) for drive in drives])
    return _encode_drives(drives, body, torch.from_numpy(maps))


def load_windows(
    root: str | Path,
    collection: Collection,
    which: Which,
    terrain: Terrain,
    pixels: int,
    body: Body = ROVER,
) -> Windows:
    """N drives of a collection as tensors, as `body` sees them.

    The maps are computed once, written beside the shards and read by memory map, so
    that processes share them: a step takes 96 bytes of memory, and 2 P^2 bytes of a
    file.
    """
    drives = load(Path(root), collection, which, terrain)
    pixels = body.pixels(pixels)
    if not pixels:
        return _encode_drives(drives, body)
    kind = ""  # the paper's kind of map has no name
    if (body.map_size, body.pose) != (ROVER.map_size, ROVER.pose):
        kind = f"-{body.map_size:g}m-{body.pose}"
    path = collection.folder(Path(root)) / f"maps-{pixels}{kind}-{digest(drives)}.npy"
    return _encode_drives(drives, body, _cached_maps(path, drives, pixels, body))


def _encode_drives(
    drives: Sequence[Drive], body: Body, maps: Tensor | None = None
) -> Windows:
    """Drives as a body sees them, with maps (N, T, P, P) if it has any."""
    states, actions = states_and_actions(drives)
    # the last state has no action: repeat the last one, and drop it again below
    actions = torch.cat([actions, actions[:, -1:]], 1)
    states, actions = states_for_body(body, drives[0].body, states, actions)
    return encode_windows(body, states, actions[:, :-1], maps)


def states_and_actions(drives: Sequence[Drive]) -> tuple[Tensor, Tensor]:
    """States (N, T + 1, S) and actions (N, T, A) of drives of equal length, float64."""
    states = np.stack([drive.states for drive in drives])
    actions = np.stack([drive.actions for drive in drives])
    return torch.from_numpy(states).double(), torch.from_numpy(actions).double()


def states_for_body(
    body: Body, recorded: Body, states: Tensor, actions: Tensor
) -> tuple[Tensor, Tensor]:
    """States and actions of the `recorded` body in the form of `body`."""
    if recorded == body:
        return states, actions
    return observation.convert_to_body(body, states, actions)


def encode_windows(
    body: Body, states: Tensor, actions: Tensor, maps: Tensor | None = None
) -> Windows:
    """Windows of states (N, T + 1, S), actions (N, T, A) and maps (N, T, P, P), m."""
    inputs = observation.encode_inputs(states[:, :-1], actions, body)
    targets = observation.transition(states[:, :-1], states[:, 1:], body)
    if maps is None:
        maps = torch.zeros(*actions.shape[:2], 0, 0, dtype=torch.float16)
    return Windows(inputs.float(), targets.float(), maps)


def drive_maps(drive: Drive, pixels: int, body: Body) -> np.ndarray:
    """Maps (T, P, P), float16, in m, as `body` sees them at the start of each step."""
    ground = drive.ground
    if ground is None:
        raise ConfigError(
            f"{drive.name}: body '{body.name}' sees a height map, "
            "and the drive has no ground"
        )
    heights = ground.heights
    states, actions = map(torch.from_numpy, (drive.states[:-1], drive.actions))
    states, _ = states_for_body(body, drive.body, states, actions)
    maps = observation.robot_centred_map(
        heights, states, pixels, body.map_size, ground.spacing, body
    )
    return maps.numpy().astype(np.float16)


def _cached_maps(
    path: Path, drives: Sequence[Drive], pixels: int, body: Body
) -> Tensor:
    """Maps (N, T, P, P), float16, m, in a file, which is written if it is missing."""
    shape = (len(drives), len(drives[0]), pixels, pixels)
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
            f"{path}: maps {maps.shape} where {shape} were expected; "
            "delete the file to make it anew"
        )
    return torch.from_numpy(maps)


def _write_maps(
    file: IO[bytes], shape: tuple[int, ...], drives: Sequence[Drive], body: Body
) -> None:
    """Write maps (N, T, P, P), drive by drive; each thread makes those of a drive."""
    header = {"descr": "<f2", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, header)
    with ThreadPoolExecutor() as pool:
        for start in range(0, len(drives), MAPS_AT_A_TIME):
            some_drives = drives[start : start + MAPS_AT_A_TIME]
            for maps in pool.map(
                lambda drive: drive_maps(drive, shape[-1], body), some_drives
            ):
                file.write(maps.data)
