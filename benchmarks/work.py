"""Random data to train on, and how many operations that takes."""

from __future__ import annotations

import torch
from torch.utils.flop_counter import FlopCounterMode

from sidm.learning import Datasets, Windows
from sidm.learning.trainer import Trainer
from sidm.learning.training import predict

STEPS, TRAJECTORIES = 64, 20


def random_data(pixels: int) -> Datasets:
    """Random numbers, which take as long as real ones."""
    draw = torch.Generator().manual_seed(0)
    sizes = (
        (TRAJECTORIES, STEPS, 11),
        (TRAJECTORIES, STEPS, 13),
        (TRAJECTORIES, STEPS, pixels, pixels),
    )
    inputs, targets, maps = (torch.randn(size, generator=draw) for size in sizes)
    motion = Windows(inputs, targets, maps.half())
    return Datasets(train=motion, test=motion, validation=motion, expert=motion)


def operations(running: Trainer) -> float:
    """Floating point operations a sample of a prediction iteration, forward and backward."""
    before = running.samples
    with FlopCounterMode(display=False) as counter:
        predict(running)
    network = running.network
    sizes = [network.latent] + [network.hidden] * network.layers
    lstm = sum(2 * 4 * network.hidden * (size + network.hidden) for size in sizes[:-1])
    # the counter does not know the LSTM
    return counter.get_total_flops() / (running.samples - before) + 3 * lstm
