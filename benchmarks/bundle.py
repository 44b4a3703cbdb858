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
from torch.utils._python_dispatch import TorchDispatchMode
from work import operations, random_data

from companion.bundle import Run, train_bundle
from companion.bundle.bundle import Bundle
from companion.bundle.bundled_trial import BundledTrial
from companion.bundle.device_data import DeviceData
from sidm.learning import PAPER_NETWORK, RELEASED_NETWORK, Network, Training, train
from sidm.learning.trainer import Trainer
from sidm.learning.training import prediction_phase
from sidm.systems import ROLES


class Case(NamedTuple):
    """Network, size and precision of a bundle; the table has a line for each."""

    name: str
    network: Network
    trials: int  # trained side by side
    #: 'float32', 'tf32' (products in TensorFloat-32) or 'bfloat16' (in the encoders)
    precision: str


SMALL = Network(pixels=16, layers=1, hidden=32, encoder_hidden=32)
LARGE = Network(pixels=64, layers=4, hidden=1024)
ON_GPU = [
    *(Case("3 x 256, 64 px", RELEASED_NETWORK, m, "float32") for m in (1, 8, 32, 128)),
    Case("3 x 256, 64 px", RELEASED_NETWORK, 128, "tf32"),
    Case("3 x 256, 64 px", RELEASED_NETWORK, 128, "bfloat16"),
    *(Case("4 x 1024, 64 px", LARGE, m, "tf32") for m in (1, 8, 32)),
    *(Case("4 x 1024, 300 px", PAPER_NETWORK, m, "tf32") for m in (1, 4, 8)),
]
ON_CPU = [Case("1 x 32, 16 px", SMALL, m, "float32") for m in (1, 4, 16)]

PHASE = 10  # prediction iterations between two readings of the clock
FIGURE3 = 320  # trials of the paper's Figure 3


class Traffic(TorchDispatchMode):
    """Counts the bytes of all tensors that operations read and write.

    Each operation is counted as if caches and fused kernels kept nothing.
    """

    def __init__(self) -> None:
        """Start at zero bytes."""
        super().__init__()
        self.bytes = 0

    def __torch_dispatch__(self, function, types, arguments=(), options=None):
        """Run one operation and count its tensors, unless it only makes a view."""
        result = function(*arguments, **(options or {}))
        if not function.is_view:
            leaves, _ = torch.utils._pytree.tree_flatten((arguments, result))
            tensors = [leaf for leaf in leaves if isinstance(leaf, torch.Tensor)]
            self.bytes += sum(t.numel() * t.element_size() for t in tensors)
        return result


def settings(case: Case, phase: int = PHASE) -> Training:
    """Training settings: batches of 8 trajectories as in `released`, never a test."""
    return Training(
        prediction_iterations=phase,
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


def make_bundle(case: Case, device: torch.device, phase: int = PHASE) -> Bundle:
    """A bundle of trials that differ only in their seeds."""
    sets, training = random_data(case.network.pixels), settings(case, phase)
    data = dict.fromkeys(ROLES, DeviceData([sets.train], device))
    bundle = Bundle(data, case.network, training, ROLES, case.trials, device)
    for seed in range(case.trials):
        bundle.join(BundledTrial(seed, Run(sets, training, seed), case.network, data))
    return bundle


def bundle_phase(bundle: Bundle) -> int:
    """Run one prediction phase of a bundle and return its number of samples."""
    bundle.prediction_phase()
    training, steps = bundle.training, bundle.data["novice"].steps
    iterations = len(bundle.slots) * training.prediction_iterations
    return iterations * training.batch * steps


def single(case: Case, device: torch.device) -> Callable[[], int]:
    """Function that runs a prediction phase of one training and counts its samples."""
    sets = random_data(case.network.pixels)
    trainer = Trainer(sets, case.network, settings(case), 0, device=device)

    def work() -> int:
        before = trainer.samples
        prediction_phase(trainer)
        return trainer.samples - before

    return work


def ceilings(device: torch.device) -> dict[str, float]:
    """Highest rates of the device: operations a second by precision, bytes a second.

    The operations are those of matrix products; 'copy' has the bytes of a copy.
    """
    size = 8192 if device.type == "cuda" else 1024
    rates = {}
    for precision in ("float32", "tf32", "bfloat16"):
        kind = torch.bfloat16 if precision == "bfloat16" else torch.float32
        left, right = torch.randn(2, size, size, device=device, dtype=kind)
        allow_tf32(precision)
        rates[precision] = per_second(
            # ndim is the 2 of the 2 n^3 operations of a product
            lambda a=left, b=right: torch.mm(a, b).ndim * size**3,
            device,
            1.0,
        )
    source = torch.zeros(2**28 if device.type == "cuda" else 2**25, device=device)
    target = torch.zeros_like(source)
    # 4 bytes of each number are read, 4 written
    rates["copy"] = per_second(lambda: target.copy_(source).numel() * 8, device, 1.0)
    return rates


def allow_tf32(precision: str) -> None:
    """Let products of float32 matrices round to TensorFloat-32 only for 'tf32'."""
    allowed = precision == "tf32"
    torch.backends.cuda.matmul.allow_tf32 = allowed
    torch.backends.cudnn.allow_tf32 = allowed


def bytes_a_sample(case: Case) -> float:
    """Bytes that a training iteration of one trial reads and writes, by sample."""
    alone = make_bundle(case._replace(trials=1), torch.device("cpu"), phase=1)
    with closing(alone) as bundle, Traffic() as traffic:
        samples = bundle_phase(bundle)
    return traffic.bytes / samples


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


class Reference(NamedTuple):
    """Figures of a network with which its bundles are compared."""

    single: float  # samples a second of a single training
    released: float  # samples a second of the stand-in of the released loop
    operations: float  # of a sample
    bytes: float  # of a sample, read and written


def reference(case: Case, device: torch.device, seconds: float) -> Reference:
    """Measure the figures with which bundles of the case's network are compared."""
    network = case.network
    loop = ReleasedLoop(network.pixels, network, str(device))
    sets = random_data(network.pixels)
    return Reference(
        per_second(single(case, device), device, seconds),
        per_second(loop.iterate, device, seconds),
        operations(Trainer(sets, network, settings(case, phase=1), 0)),
        bytes_a_sample(case),
    )


def measure(cases: Iterable[Case], device: torch.device, seconds: float) -> float:
    """Print a line for each case.

    Returns:
        The most samples a second that bundles of the first network made.
    """
    limits, first, best = ceilings(device), None, 0.0
    units = {name: "TB/s" if name == "copy" else "TFLOP/s" for name in limits}
    print(
        ", ".join(f"{name} {limits[name] / 1e12:.3g} {units[name]}" for name in units)
    )
    print(
        "network, precision, M: trial-iterations/s; samples/s; of products; "
        "of copies; x single; x released way"
    )
    references: dict[Network, Reference] = {}
    for case in cases:
        allow_tf32(case.precision)
        if case.network not in references:
            references[case.network] = reference(case, device, seconds)
        compared = references[case.network]
        with closing(make_bundle(case, device)) as bundle:
            rate = per_second(functools.partial(bundle_phase, bundle), device, seconds)
        first = first or case.network
        best = max(best, rate) if case.network == first else best
        print(
            f"{case.name}, {case.precision}, {case.trials:4d}: "
            f"{rate / 512:9.1f}; {rate:11.0f}; "
            f"{rate * compared.operations / limits[case.precision]:.3f}; "
            f"{rate * compared.bytes / limits['copy']:.3f}; "
            f"{rate / compared.single:.2f}; {rate / compared.released:.2f}",
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
