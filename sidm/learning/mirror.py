"""Left and right exchanged: the paper's robots are alike on both sides, so a mirror image is motion of theirs too."""

from __future__ import annotations

import torch
from torch import Tensor

from sidm.learning.dataset import Windows

#: Signs in the mirror image, in the order of the tables of `observation`: vectors turn their y component, axes of
#: rotation the other two, and steering turns.
INPUT_SIGNS = (1, -1, 1, 1, -1, 1, -1, 1, -1, 1, -1)
TARGET_SIGNS = (1, -1, 1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1)


def mirrored(motion: Windows, which: Tensor) -> Windows:
    """The trajectories `which` (N,), bool, of a motion in mirror image, the others as they are."""

    def turned(values: Tensor, signs: tuple[int, ...]) -> Tensor:
        return torch.where(which[:, None, None], values * values.new_tensor(signs), values)

    maps = torch.where(which[:, None, None, None], motion.maps.flip(-2), motion.maps)  # axis -2 runs to the left
    return Windows(turned(motion.inputs, INPUT_SIGNS), turned(motion.targets, TARGET_SIGNS), maps)
