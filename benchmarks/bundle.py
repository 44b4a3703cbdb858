"""Measure how fast bundles of trials train on the GPU of this machine.

`python benchmarks/bundle.py` takes less than eight minutes. Without a GPU it measures
small networks on the CPU, and the table says so. Each bundle is compared with a single
training (cuDNN's LSTM on a GPU) and with a stand-in of the released loop, both measured
on the same device in the same run.
"""

from __future__ import annotations

import argparse
import functools
import platform
import time
from collections.abc import Callable, Iterable
from contextlib import closing
from typing import NamedTuple

import torch
from released import ReleasedLoop
from work import random_data

from companion.bundle import Run, train_bundle
from companion.bundle.bundle import Bundle
from companion.bundle.bundled_trial import BundledTrial
from companion.bundle.device_data import DeviceData
from sidm.learning import PAPER_NETWORK, RELEASED_NETWORK, Network, Training, train
from sidm.learning.trainer import Trainer
from sidm.learning.training import prediction_phase


class Case(NamedTuple):
    """Network, size and precision of a bundle; the table has a line for each."""

    name: str
    network: Network
    trials: int  # trained side by side
    precision: str  # 'float32' or 'tf32' (products in TensorFloat-32)


SMALL = Network(pixels=16, layers=1, hidden=32, encoder_hidden=32)
LARGE = Network(pixels=64, layers=4, hidden=1024)
ON_GPU = [
    *(Case("3 x 256, 64 px", RELEASED_NETWORK, m, "float32") for m in (1, 8, 32, 128)),
    Case("3 x 256, 64 px", RELEASED_NETWORK, 128, "tf32"),
    *(Case("4 x 1024, 64 px", LARGE, m, "tf32") for m in (1, 8, 32)),
    *(Case("4 x 1024, 300 px", PAPER_NETWORK, m, "tf32") for m in (1, 4, 8)),
]
ON_CPU = [Case("1 x 32, 16 px", SMALL, m, "float32") for m in (1, 4, 16)]

PHASE = 10  # prediction iterations between two readings of the clock
FIGURE3 = 320  # trials of the paper's Figure 3


def settings(case: Case) -> Training:
    """Training settings: batches of 8 trajectories as in `released`, never a test."""
    return Training(
        prediction_iterations=PHASE,
        test_interval=10**6,
        max_samples=10**9,
        precision=case.precision,
    )


def per_second(work: Callable[[], int], device: torch.device, seconds: float) -> float:
    """Units of work a second of wall-clock time, measured for about `seconds`.

    `work` does some units of work and returns their number.
    """

    def wait() -> None:
        if device.type == "cuda":
            torch.cuda.synchronize()

    work()
    wait()
    start, done = time.perf_counter(), 0
    while time.perf_counter() - start < seconds:
        done += work()
        wait()
    return done / (time.perf_counter() - start)


def make_bundle(case: Case, device: torch.device) -> Bundle:
    """A bundle of trials that differ only in their seeds."""
    sets, training = random_data(case.network.pixels), settings(case)
    data = DeviceData([sets.train], device)
    trials = [
        BundledTrial(seed, Run(sets, training, seed), case.network, data)
        for seed in range(case.trials)
    ]
    return Bundle(trials, data, device)


def bundle_phase(bundle: Bundle) -> int:
    """Run one prediction phase of a bundle and return its number of samples."""
    bundle.prediction_phase()
    training = bundle.training
    iterations = len(bundle.trials) * training.prediction_iterations
    return iterations * training.batch * bundle.trials[0].steps


def single(case: Case, device: torch.device) -> Callable[[], int]:
    """Function that runs a prediction phase of one training and counts its samples."""
    sets = random_data(case.network.pixels)
    trainer = Trainer(sets, case.network, settings(case), 0, device=device)

    def work() -> int:
        before = trainer.samples
        prediction_phase(trainer)
        return trainer.samples - before

    return work


def allow_tf32(precision: str) -> None:
    """Let products of float32 matrices round to TensorFloat-32 only for 'tf32'."""
    allowed = precision == "tf32"
    torch.backends.cuda.matmul.allow_tf32 = allowed
    torch.backends.cudnn.allow_tf32 = allowed


def agreement(device: torch.device) -> float:
    """Largest relative difference of test losses, a bundle of 5 to 5 single runs."""
    allow_tf32("float32")
    sets = random_data(SMALL.pixels)
    training = Training(
        prediction_iterations=10, test_interval=5, max_samples=8 * 64 * 40
    )
    runs = [Run(sets, training, seed) for seed in range(5)]
    worst = 0.0
    for ended in train_bundle(runs, SMALL, 5, device):
        alone = train(sets, SMALL, training, ended.number, device=device)
        for in_bundle, single_run in zip(
            ended.result.history, alone.history, strict=True
        ):
            worst = max(worst, abs(in_bundle.test_loss / single_run.test_loss - 1))
    return worst


def measure(cases: Iterable[Case], device: torch.device, seconds: float) -> float:
    """Print a line for each case.

    Returns:
        The most samples a second that bundles of the first network made.
    """
    print(
        "network, precision, M: trial-iterations/s; samples/s; x single; x released way"
    )
    first, best = None, 0.0
    compared: dict[Network, tuple[float, float]] = {}
    for case in cases:
        allow_tf32(case.precision)
        if case.network not in compared:
            loop = ReleasedLoop(case.network.pixels, case.network, str(device))
            compared[case.network] = (
                per_second(single(case, device), device, seconds),
                per_second(loop.iterate, device, seconds),
            )
        alone, released = compared[case.network]
        with closing(make_bundle(case, device)) as bundle:
            rate = per_second(functools.partial(bundle_phase, bundle), device, seconds)
        first = first or case.network
        best = max(best, rate) if case.network == first else best
        print(
            f"{case.name}, {case.precision}, {case.trials:4d}: {rate / 512:9.1f}; "
            f"{rate:11.0f}; {rate / alone:.2f}; {rate / released:.2f}",
            flush=True,
        )
    return best


def main() -> None:
    """Print the table and the hours that Figure 3 would take at the best rate."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    usual = "cuda" if torch.cuda.is_available() else "cpu"
    parser.add_argument("--device", default=usual)
    parser.add_argument("--seconds", type=float, default=8, help="of each measurement")
    options = parser.parse_args()
    device = torch.device(options.device)
    gpu = device.type == "cuda"
    name = f"{platform.machine()} CPU, SMALL SIZES, not a GPU"
    name = torch.cuda.get_device_name(device) if gpu else name
    print(
        f"# benchmarks/bundle.py on {name}, {torch.get_num_threads()} threads, "
        f"Python {platform.python_version()}, torch {torch.__version__}"
    )
    print(
        "test losses of a bundle of 5 and of 5 trainings alone differ "
        f"by at most {agreement(device):.1e}, relative"
    )
    best = measure(ON_GPU if gpu else ON_CPU, device, options.seconds)
    if gpu:
        hours = [FIGURE3 * samples / best / 3600 for samples in (1e6, 20e6)]
        print(
            f"{FIGURE3} trials at the best rate, 1 and 20 million samples each: "
            f"{hours[0]:.2f} h, {hours[1]:.1f} h"
        )


if __name__ == "__main__":
    main()
