"""From drives to tensors: windows of equal length."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from sidm.config import ConfigError, replace
from sidm.drives import Drive, Ground
from sidm.learning import observation

Indices = Tensor | np.ndarray | Sequence[int]  # or a mask


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
        chosen = torch.as_tensor(indices)
        if chosen.dtype == torch.bool:  # a mask (N,)
            chosen = chosen.nonzero()[:, 0]
        chosen = chosen.long()
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
    drives: Sequence[Drive], pixels: int, maps: Tensor | None = None
) -> Windows:
    """Drives of equal length T as tensors, with maps of their ground.

    Args:
        drives: of one robot.
        pixels: P, pixels along a side of the maps, unless the body gives this number.
        maps: (N, T, P, P), float16, m, where they were computed before.

    Raises:
        GroundError: simulated ground that cannot be made again as it was.
        ConfigError: the body sees a height map, and a drive has no ground.
        ValueError: no drives.
    """
    if not drives:
        raise ValueError("no drives to make windows of")
    body = drives[0].body
    states, actions = states_and_actions(drives)
    inputs = observation.encode_inputs(states[:, :-1], actions, body)
    targets = observation.transition(states[:, :-1], states[:, 1:], body)
    if maps is None and body.pixels(pixels):
        computed = np.stack([drive_maps(drive, pixels) for drive in drives])
        maps = torch.from_numpy(computed)
    elif maps is None:
        maps = torch.zeros(*actions.shape[:2], 0, 0, dtype=torch.float16)
    return Windows(inputs.float(), targets.float(), maps)


def states_and_actions(drives: Sequence[Drive]) -> tuple[Tensor, Tensor]:
    """States (N, T + 1, S) and actions (N, T, A) of drives of equal length, float64."""
    states = np.stack([drive.states for drive in drives])
    actions = np.stack([drive.actions for drive in drives])
    return torch.from_numpy(states).double(), torch.from_numpy(actions).double()


def drive_maps(drive: Drive, pixels: int) -> np.ndarray:
    """Maps (T, P, P), float16, in m, as the body sees them when each step starts.

    P is `pixels` unless the body gives this number.
    """
    ground, body = drive.ground, drive.body
    if ground is None:
        raise ConfigError(
            f"{drive.name}: body '{body.name}' sees a height map, "
            "and the drive has no ground"
        )
    states = torch.from_numpy(drive.states[:-1])
    if isinstance(ground, Ground) and any(ground.centre):
        states = states.clone()
        states[:, :2] -= torch.tensor(ground.centre, dtype=states.dtype)
    maps = observation.robot_centred_map(
        ground.heights,
        states,
        body.pixels(pixels),
        body.map_size,
        ground.spacing,
        body,
    )
    return maps.numpy().astype(np.float16)
