"""The trajectories of many trials on one device; shared ones are copied once."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import torch
from torch import Tensor

from sidm.config import ConfigError, replace
from sidm.learning.dataset import Windows

AT_A_TIME = 256  # trajectories copied to the device in one step


class DeviceData:
    """All trajectories that a bundle learns from and tests on.

    Raises:
        ConfigError: the windows differ in steps or pixels.

    Attributes:
        windows: all trajectories, on the device
        steps: number of steps T of every trajectory
    """

    def __init__(self, windows: Iterable[Windows], device: torch.device) -> None:
        # windows that share tensors are copied together, with all that is stored
        self._stored = {
            id(part.stored_inputs): replace(part, rows=None) for part in windows
        }
        parts = list(self._stored.values())
        shapes = {tuple(part.maps.shape[1:]) for part in parts}
        if len(shapes) > 1:
            raise ConfigError(
                "the maps (T, P, P) of a bundle must have one shape, "
                f"not {sorted(shapes)}"
            )
        first_rows = itertools.accumulate(map(len, parts), initial=0)
        self._first_row = dict(zip(self._stored, first_rows, strict=False))
        inputs, targets, maps = (
            _concatenated([getattr(part, name) for part in parts], device)
            for name in ("inputs", "targets", "maps")
        )
        self.windows, self.steps = Windows(inputs, targets, maps), inputs.shape[1]

    def rows(self, windows: Windows) -> Tensor:
        """Row of each trajectory in this data: (N,) int64, on the CPU."""
        return windows.row_indices + self._first_row[id(windows.stored_inputs)]


def _concatenated(tensors: list[Tensor], device: torch.device) -> Tensor:
    """All rows of the tensors on the device.

    They are copied piece by piece, so that no memory-mapped file is held twice.
    """
    count, first = sum(map(len, tensors)), tensors[0]
    rows = torch.empty(count, *first.shape[1:], dtype=first.dtype, device=device)
    start = 0
    for tensor in tensors:
        for piece in tensor.split(AT_A_TIME):
            rows[start : start + len(piece)] = piece
            start += len(piece)
    return rows
