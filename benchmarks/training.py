"""How many samples a second training takes on two cores, beside a stand-in of the released loop, in one run.

Ours trains two trials at once, a process and a thread each; the stand-in is one process of two threads, as released.
"""

from __future__ import annotations

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

from sidm.learning import Network, Training
from sidm.learning.learner import Learner
from sidm.learning.training import predict_phase

ROUNDS = 5


@functools.cache
def learner(pixels: int, batch: int, precision: str) -> Learner:
    """A training on random numbers, which take as long as real ones; of this process."""
    torch.set_num_threads(1)
    training = Training(
        batch=batch, prediction_iterations=5, test_interval=10**6, max_samples=10**9, precision=precision
    )
    return Learner(random_data(pixels), Network(pixels=pixels), training, seed=0)


def train(pixels: int, batch: int, precision: str) -> float:
    """Samples a second of wall-clock time of four short phases, in this process."""
    running = learner(pixels, batch, precision)
    before, start = running.samples, time.perf_counter()
    for _ in range(4):
        predict_phase(running)
    return (running.samples - before) / (time.perf_counter() - start)


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
    stand_ins = {f"stand-in, resampling at {side} px": ReleasedLoop(side) for side in (64, 300)}
    ours = {f"ours, {precision}": (64, 2, precision) for precision in ("float32", "bfloat16")}
    laptop = {f"32 px, batch 8 x 64, {precision}": (32, 8, precision) for precision in ("float32", "bfloat16")}
    rates: dict[str, list[float]] = {}
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for work in (*ours.values(), *laptop.values()):
            two_at_once(pool, *work)  # warm up
        torch.set_num_threads(2)
        for _ in range(ROUNDS):
            for name, loop in stand_ins.items():
                start = time.perf_counter()
                rates.setdefault(name, []).append(loop.iterate() / (time.perf_counter() - start))
            for name, work in (ours | laptop).items():
                rates.setdefault(name, []).append(two_at_once(pool, *work))
    for name, found in rates.items():
        report(name, np.array(found), "samples a s", None if name in laptop else RELEASED)
    for name in ours:
        for stand_in in stand_ins:
            report(f"{name} / {stand_in}", np.array(rates[name]) / np.array(rates[stand_in]), "times")
    torch.set_num_threads(1)
    products, each = np.median(rate(matrix_products())), operations(learner(64, 2, "float32"))
    share = np.median(rates["ours, float32"]) / 2 * each / products
    print(f"floor: {each / 1e6:.1f} million operations a sample; at {products / 1e9:.0f} GFLOP/s of products a core")
    print(f"    at most {2 * products / each:.0f} samples a s on two cores; our share of it {share:.2f} in float32")


if __name__ == "__main__":
    main()
