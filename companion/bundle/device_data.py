"""The trajectories of many trials on one device.

What several trials share is copied once.
"""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor

from sidm.config import ConfigError, replace
from sidm.learning.dataset import Windows

#: row of an all-zero trajectory, for entries of a batch that need none
BLANK = 0
AT_A_TIME = 256  # trajectories copied to the device in one step


class DeviceData:
    """All trajectories that a bundle learns from and tests on, of robots of one body.

    Attributes:
        windows: all trajectories, on the device; row 0 is blank
    """

    def __init__(self, windows: Iterable[Windows], device: torch.device):
        """Copy all data that `windows` refer to onto `device`.

        Raises:
            ConfigError: the windows differ in steps or pixels, or the device has too
                little memory.
        """
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
        check_memory(parts, device)
        self._first_row, count = {}, BLANK + 1
        for key, part in self._stored.items():
            self._first_row[key], count = count, count + len(part)
        inputs, targets, maps = (
            _concatenated([getattr(part, name) for part in parts], count, device)
            for name in ("inputs", "targets", "maps")
        )
        self.windows = Windows(inputs, targets, maps)

    @property
    def steps(self) -> int:
        """Number of steps T of every trajectory."""
        return self.windows.inputs.shape[1]

    def rows(self, windows: Windows) -> Tensor:
        """Row of each trajectory in this data: (N,) int64, on the CPU.

        Args:
            windows: N trajectories, of those that were copied.
        """
        return windows.row_indices + self._first_row[id(windows.stored_inputs)]


def check_memory(windows: Iterable[Windows], device: torch.device) -> None:
    """Refuse maps that are larger than the free memory of a GPU.

    Raises:
        ConfigError: they do not fit.
    """
    needed = sum(part.maps.numel() * part.maps.element_size() for part in windows)
    if device.type == "cuda" and needed > (free := torch.cuda.mem_get_info(device)[0]):
        raise ConfigError(
            f"the maps take {needed / 2**30:.0f} GiB and {device} has "
            f"{free / 2**30:.0f} free; choose fewer pixels or leave out the bundle"
        )


def _concatenated(tensors: list[Tensor], count: int, device: torch.device) -> Tensor:
    """All rows of the tensors behind a blank one: (count, ...), on the device.

    They are copied piece by piece, so that no memory-mapped file is held twice.
    """
    shape, dtype = tensors[0].shape[1:], tensors[0].dtype
    rows = torch.empty(count, *shape, dtype=dtype, device=device)
    rows[BLANK] = 0
    start = BLANK + 1
    for tensor in tensors:
        for piece in tensor.split(AT_A_TIME):
            rows[start : start + len(piece)] = piece
            start += len(piece)
    return rows
