"""Random data to train on."""

from __future__ import annotations

import torch

from sidm.learning import Datasets, Windows

STEPS, TRAJECTORIES = 64, 20


def random_data(pixels: int) -> Datasets:
    """Data sets of random numbers, which take as long as real ones."""
    generator = torch.Generator().manual_seed(0)
    inputs, targets, maps = (
        torch.randn((TRAJECTORIES, STEPS, *size), generator=generator)
        for size in ((11,), (13,), (pixels, pixels))
    )
    motion = Windows(inputs, targets, maps.half())
    return Datasets(train=motion, test=motion, validation=motion, expert=motion)
