"""Random data to train on, and the number of operations of the training."""

from __future__ import annotations

import torch
from torch.utils.flop_counter import FlopCounterMode

from sidm.learning import Datasets, Windows
from sidm.learning.trainer import Trainer
from sidm.learning.training import prediction_phase

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


def operations(running: Trainer) -> float:
    """Floating point operations of a prediction iteration by sample, both passes."""
    before = running.samples
    with FlopCounterMode(display=False) as counter:
        prediction_phase(running)
    network = running.network
    sizes = [network.latent] + [network.hidden] * network.layers
    lstm = sum(2 * 4 * network.hidden * (size + network.hidden) for size in sizes[:-1])
    # the counter leaves out the LSTM; its backward pass costs twice its forward pass
    return counter.get_total_flops() / (running.samples - before) + 3 * lstm
