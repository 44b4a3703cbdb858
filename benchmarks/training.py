"""Measure the samples a second of training on two cores, beside the released loop.

This repository trains two trials at once, each in a process with one thread. The
stand-in of the released loop runs in one process with two threads, as released. Both
are measured in one run. Training without compiled convolutions and with denormal
numbers shows what these two measures bring.
"""

from __future__ import annotations

import contextlib
import functools
import multiprocessing
import time
from multiprocessing.pool import Pool

import numpy as np
import torch
from released import RELEASED, ReleasedLoop
from rounds import report
from work import random_data

from sidm.learning import Network, Training, convolution
from sidm.learning.arithmetic import flushed_denormals
from sidm.learning.trainer import Trainer
from sidm.learning.training import prediction_phase

ROUNDS = 5


@functools.cache
def trainer(pixels: int, batch: int) -> Trainer:
    """This process's training on random numbers, which take as long as real ones."""
    torch.set_num_threads(1)
    training = Training(
        batch=batch,
        prediction_iterations=5,
        test_interval=10**6,
        max_samples=10**9,
    )
    return Trainer(random_data(pixels), Network(pixels=pixels), training, seed=0)


def train(pixels: int, batch: int, plain: bool = False) -> float:
    """Samples a second of wall-clock time of four short phases in this process.

    `plain` trains with PyTorch alone.
    """
    running, kernels = trainer(pixels, batch), convolution.kernels
    convolution.kernels = (lambda: None) if plain else kernels
    try:
        with contextlib.nullcontext() if plain else flushed_denormals():
            before, start = running.samples, time.perf_counter()
            for _ in range(4):
                prediction_phase(running)
            return (running.samples - before) / (time.perf_counter() - start)
    finally:
        convolution.kernels = kernels


def two_at_once(pool: Pool, *work: object) -> float:
    """Sum of the rates of two processes that do the same work at once."""
    return sum(pool.starmap(train, [work] * 2, chunksize=1))


def main() -> None:
    """Measure workloads of the released and the laptop preset, and the stand-ins."""
    stand_ins = {
        f"stand-in, resampling at {side} px": ReleasedLoop(side) for side in (64, 300)
    }
    sizes = {
        "64 px, batch 2": (64, 2),
        "32 px, batch 8": (32, 8),
        "32 px, batch 2": (32, 2),
    }
    workloads: dict[str, tuple] = {
        f"{name}, {label}": (*size, *options)
        for label, options in (
            ("float32", ()),
            ("PyTorch alone", (True,)),
        )
        for name, size in sizes.items()
    }
    rates: dict[str, list[float]] = {}
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for work in workloads.values():
            two_at_once(pool, *work)  # warm up
        torch.set_num_threads(2)
        for _ in range(ROUNDS):
            for name, loop in stand_ins.items():
                start = time.perf_counter()
                samples = loop.iterate()
                pace = samples / (time.perf_counter() - start)
                rates.setdefault(name, []).append(pace)
            for name, work in workloads.items():
                rates.setdefault(name, []).append(two_at_once(pool, *work))
    table = {name: np.array(values) for name, values in rates.items()}
    released = "64 px, batch 2, float32"
    for name, values in table.items():
        compared = RELEASED if name in (*stand_ins, released) else None
        report(name, values, "samples a s", compared)
    for name in sizes:
        ratio = table[f"{name}, float32"] / table[f"{name}, PyTorch alone"]
        report(f"{name}: compiled / PyTorch alone", ratio, "times")
    for name in stand_ins:
        report(f"{released} / {name}", table[released] / table[name], "times")


if __name__ == "__main__":
    main()
