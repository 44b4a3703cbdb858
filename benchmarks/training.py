"""How many samples a second training takes on two cores, beside a stand-in of the released loop, in one run.

Ours trains two trials at once, a process and a thread each; the stand-in is one process
of two threads, as released. What the compiled convolutions and flushed denormal numbers
bring is measured against training without either.
"""

from __future__ import annotations

import contextlib
import functools
import multiprocessing
import time
from collections.abc import Callable
from multiprocessing.pool import Pool

import numpy as np
import torch
from released import RELEASED, ReleasedLoop
from rounds import rate, report
from work import operations, random_data

from sidm.learning import Network, Training, convolution
from sidm.learning.arithmetic import flushed_denormals
from sidm.learning.trainer import Trainer
from sidm.learning.training import predict

ROUNDS = 5


@functools.cache
def trainer(pixels: int, batch: int, precision: str) -> Trainer:
    """A training on random numbers, which take as long as real ones; of this process."""
    torch.set_num_threads(1)
    training = Training(
        batch=batch,
        prediction_iterations=5,
        test_interval=10**6,
        max_samples=10**9,
        precision=precision,
    )
    return Trainer(random_data(pixels), Network(pixels=pixels), training, seed=0)


def train(pixels: int, batch: int, precision: str, plain: bool = False) -> float:
    """Samples a second of wall-clock time of four short phases, in this process; `plain`: by PyTorch alone."""
    running, kernels = trainer(pixels, batch, precision), convolution.kernels
    convolution.kernels = (lambda: None) if plain else kernels
    try:
        with contextlib.nullcontext() if plain else flushed_denormals():
            before, start = running.samples, time.perf_counter()
            for _ in range(4):
                predict(running)
            return (running.samples - before) / (time.perf_counter() - start)
    finally:
        convolution.kernels = kernels


def two_at_once(pool: Pool, *work: object) -> float:
    """The rates of two processes at the same work, added."""
    return sum(pool.starmap(train, [work] * 2, chunksize=1))


def matrix_products(size: int = 1024) -> Callable[[], int]:
    """Work that multiplies square matrices, in operations."""
    left, right = torch.randn(2, size, size)

    def multiply() -> int:
        torch.mm(left, right)
        return 2 * size**3

    return multiply


def main() -> None:
    """Measure the released workload in turns with its stand-in, then the laptop preset's, and the floor."""
    stand_ins = {
        f"stand-in, resampling at {side} px": ReleasedLoop(side) for side in (64, 300)
    }
    sizes = {
        "64 px, batch 2": (64, 2),
        "32 px, batch 8": (32, 8),
        "32 px, batch 2": (32, 2),
    }
    ours = {f"{words}, float32": (*size, "float32") for words, size in sizes.items()}
    plain = {
        f"{words}, PyTorch alone": (*size, "float32", True)
        for words, size in sizes.items()
    }
    low = {f"{words}, bfloat16": (*size, "bfloat16") for words, size in sizes.items()}
    rates: dict[str, list[float]] = {}
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for work in (*ours.values(), *plain.values(), *low.values()):
            two_at_once(pool, *work)  # warm up
        torch.set_num_threads(2)
        for _ in range(ROUNDS):
            for name, loop in stand_ins.items():
                start = time.perf_counter()
                rates.setdefault(name, []).append(
                    loop.iterate() / (time.perf_counter() - start)
                )
            for name, work in (ours | plain | low).items():
                rates.setdefault(name, []).append(two_at_once(pool, *work))
    released = "64 px, batch 2, float32"
    for name, found in rates.items():
        report(
            name,
            np.array(found),
            "samples a s",
            RELEASED if name in (*stand_ins, released) else None,
        )
    for words in sizes:
        ratio = np.array(rates[f"{words}, float32"]) / np.array(
            rates[f"{words}, PyTorch alone"]
        )
        report(f"{words}: compiled / PyTorch alone", ratio, "times")
    for stand_in in stand_ins:
        report(
            f"{released} / {stand_in}",
            np.array(rates[released]) / np.array(rates[stand_in]),
            "times",
        )
    torch.set_num_threads(1)
    products, each = (
        np.median(rate(matrix_products())),
        operations(trainer(64, 2, "float32")),
    )
    share = np.median(rates[released]) / 2 * each / products
    print(
        f"floor: {each / 1e6:.1f} million operations a sample; at {products / 1e9:.0f} GFLOP/s of products a core"
    )
    print(
        f"    at most {2 * products / each:.0f} samples a s on two cores; our share of it {share:.2f} in float32"
    )


if __name__ == "__main__":
    main()
