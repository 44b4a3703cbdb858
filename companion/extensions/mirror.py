"""Mirror images of motion, left and right exchanged.

The paper's robots are the same on both sides, so a mirror image is also a motion of
these robots.
"""

from __future__ import annotations

import torch
from torch import Tensor

from sidm.learning.dataset import Datasets, Windows
from sidm.learning.sampler import PURPOSES, Sampler
from sidm.learning.seeds import generator
from sidm.learning.trainer import Hook
from sidm.settings import Training

#: Signs of the components in the mirror image, in the order of the tables of
#: `observation`. Vectors change the sign of y; axes of rotation change the signs of x
#: and z; the steering angle changes its sign.
INPUT_SIGNS = (1, -1, 1, 1, -1, 1, -1, 1, -1, 1, -1)
TARGET_SIGNS = (1, -1, 1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1)


def mirrored(motion: Windows, which: Tensor) -> Windows:
    """A motion with the trajectories `which` (N,), bool, in mirror image."""

    def mirror(values: Tensor, signs: tuple[int, ...]) -> Tensor:
        images = values * values.new_tensor(signs)
        return torch.where(which[:, None, None], images, values)

    # axis -2 of a map runs to the left
    maps = torch.where(which[:, None, None, None], motion.maps.flip(-2), motion.maps)
    return Windows(
        mirror(motion.inputs, INPUT_SIGNS), mirror(motion.targets, TARGET_SIGNS), maps
    )


def mirror_image(windows: Windows) -> Windows:
    """All windows in mirror image."""
    return mirrored(windows, torch.ones(len(windows), dtype=torch.bool))


class MirroredSampler(Sampler):
    """Draws windows and their mirror images, each with probability 0.5.

    Indices from the number of a system's windows upwards stand for mirror images.
    """

    def __init__(
        self, datasets: Datasets, training: Training, seed: int, device: torch.device
    ) -> None:
        super().__init__(datasets, training, seed, device)
        self.generators |= {
            f"{purpose} mirrored": generator(seed, f"{purpose} mirrored")
            for purpose in PURPOSES[1:]
        }

    def indices(self, role: str, count: int, purpose: str) -> Tensor:
        """Random indices (count,) int64 of a system's windows and mirror images."""
        indices = super().indices(role, count, purpose)
        noise = torch.rand(count, generator=self.generators[f"{purpose} mirrored"])
        return indices + len(self.windows[role]) * (noise < 0.5)

    def take(self, role: str, which: Tensor) -> Windows:
        """Windows (b, T) of a system, or mirror images, by numbers from `indices`."""
        windows = self.windows[role]
        count = len(windows)
        return mirrored(windows.take(which % count), which >= count).to(self.device)


class Mirroring(Hook):
    """Training on windows and their mirror images, each with probability 0.5."""

    def sampler(
        self, datasets: Datasets, training: Training, seed: int, device: torch.device
    ) -> Sampler:
        """A sampler that draws mirror images, too."""
        return MirroredSampler(datasets, training, seed, device)
