"""Left and right exchanged: the paper's robots are alike on both sides, so a mirror image is motion of theirs too."""

from __future__ import annotations

import torch
from torch import Tensor

from sidm.learning.dataset import Datasets, Windows
from sidm.learning.sampler import PURPOSES, Sampler
from sidm.learning.seeds import generator
from sidm.learning.trainer import Hook
from sidm.settings import Training

#: Signs in the mirror image, in the order of the tables of `observation`: vectors turn
#: their y component, axes of rotation the other two, and steering turns.
INPUT_SIGNS = (1, -1, 1, 1, -1, 1, -1, 1, -1, 1, -1)
TARGET_SIGNS = (1, -1, 1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1)


def mirrored(motion: Windows, which: Tensor) -> Windows:
    """The trajectories `which` (N,), bool, of a motion in mirror image, the others as they are."""

    def turned(values: Tensor, signs: tuple[int, ...]) -> Tensor:
        return torch.where(
            which[:, None, None], values * values.new_tensor(signs), values
        )

    # axis -2 runs to the left
    maps = torch.where(which[:, None, None, None], motion.maps.flip(-2), motion.maps)
    return Windows(
        turned(motion.inputs, INPUT_SIGNS), turned(motion.targets, TARGET_SIGNS), maps
    )


def mirror_image(windows: Windows) -> Windows:
    """All of some windows in mirror image."""
    return mirrored(windows, torch.ones(len(windows), dtype=torch.bool))


class MirroredSampler(Sampler):
    """Draws mirror images, too: a system's stand behind its windows, and every second draw at random goes there."""

    def __init__(
        self, datasets: Datasets, training: Training, seed: int, device: torch.device
    ) -> None:
        super().__init__(datasets, training, seed, device)
        self.generators |= {
            f"{purpose} mirrored": generator(seed, f"{purpose} mirrored")
            for purpose in PURPOSES[1:]
        }

    def indices(self, role: str, count: int, purpose: str) -> Tensor:
        """(count,) int64: which of a system's windows, or of their mirror images behind them, to learn from."""
        drawn = super().indices(role, count, purpose)
        turned = (
            torch.rand(count, generator=self.generators[f"{purpose} mirrored"]) < 0.5
        )
        return drawn + len(self.windows[role]) * turned

    def take(self, role: str, which: Tensor) -> Windows:
        """A system's windows (b, T) numbered `which` (b,), or their mirror images, on the device."""
        count = len(self.windows[role])
        return mirrored(self.windows[role].take(which % count), which >= count).to(
            self.device
        )


class Mirroring(Hook):
    """Left and right of windows are exchanged, of each drawn with probability 0.5."""

    def sampler(
        self, datasets: Datasets, training: Training, seed: int, device: torch.device
    ) -> Sampler:
        """A sampler that draws mirror images, too."""
        return MirroredSampler(datasets, training, seed, device)
