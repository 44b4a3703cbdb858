"""The trajectories of many trials on one device, each once: what trials share is not copied for every one."""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor

from sidm.config import ConfigError, replace
from sidm.learning.dataset import Windows

#: the place of a trajectory of zeros, for places of a batch where none was drawn
BLANK = 0


class Shelf:
    """All trajectories that some trials learn from and test on, of systems of one body."""

    def __init__(self, motions: Iterable[Windows], device: torch.device):
        """Copy the data of `motions` to `device`.

        Raises:
            ConfigError: they differ in steps or pixels, or do not fit.
        """
        self._wholes = {
            id(one.stored_inputs): replace(one, rows=None) for one in motions
        }
        shapes = {tuple(whole.maps.shape[1:]) for whole in self._wholes.values()}
        if len(shapes) > 1:
            raise ConfigError(
                f"the maps (T, P, P) of a bundle must have one shape, not {sorted(shapes)}"
            )
        refuse_too_much(self._wholes.values(), device)
        self._first, count = {}, BLANK + 1
        for key, whole in self._wholes.items():
            self._first[key], count = count, count + len(whole)
        self.motion = Windows(
            *(
                _copied(
                    [getattr(whole, name) for whole in self._wholes.values()],
                    count,
                    device,
                )
                for name in ("inputs", "targets", "maps")
            )
        )

    @property
    def steps(self) -> int:
        """T of every trajectory."""
        return self.motion.inputs.shape[1]

    def places(self, motion: Windows) -> Tensor:
        """(N,) int64, on the CPU: where the trajectories of `motion`, one of those given, stand."""
        return motion.places + self._first[id(motion.stored_inputs)]


def refuse_too_much(motions: Iterable[Windows], device: torch.device) -> None:
    """ConfigError when the maps are larger than what is free on a GPU."""
    needed = sum(motion.maps.numel() * motion.maps.element_size() for motion in motions)
    if device.type == "cuda" and needed > (free := torch.cuda.mem_get_info(device)[0]):
        raise ConfigError(
            f"the maps take {needed / 2**30:.0f} GiB and {device} has {free / 2**30:.0f} free; "
            "choose fewer pixels or leave out the bundle"
        )


def _copied(tensors: list[Tensor], count: int, device: torch.device) -> Tensor:
    """All rows in one tensor on the device, behind a blank one; piece by piece, so that files are never held twice."""
    together = torch.empty(
        count, *tensors[0].shape[1:], dtype=tensors[0].dtype, device=device
    )
    together[BLANK] = 0
    start = BLANK + 1
    for tensor in tensors:
        for piece in tensor.split(256):
            together[start : start + len(piece)] = piece
            start += len(piece)
    return together
