"""How fast bundles of trials train on this machine's GPU: python benchmarks/bundle.py, under eight minutes.

Without a GPU the same is done at small sizes on the CPU, and the table says so. Beside
each bundle stand a single training (cuDNN's LSTM on a GPU) and a stand-in of the
released loop on the same device, measured in the same run.
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
from companion.bundle.seat import Seat
from companion.bundle.shelf import Shelf
from sidm.learning import PAPER_NETWORK, RELEASED_NETWORK, Network, Training, train
from sidm.learning.trainer import Trainer
from sidm.learning.training import predict
from sidm.systems import ROLES


class Case(NamedTuple):
    """A line of the table."""

    name: str
    network: Network
    trials: int  # side by side
    #: 'float32', 'tf32': products in TensorFloat-32, 'bfloat16': the encoders
    precision: str


SMALL = Network(pixels=16, layers=1, hidden=32, encoder_hidden=32)
LARGE = Network(pixels=64, layers=4, hidden=1024)
ON_GPU = [
    *(
        Case("3 x 256, 64 px", RELEASED_NETWORK, trials, "float32")
        for trials in (1, 8, 32, 128)
    ),
    *(
        Case("3 x 256, 64 px", RELEASED_NETWORK, 128, precision)
        for precision in ("tf32", "bfloat16")
    ),
    *(Case("4 x 1024, 64 px", LARGE, trials, "tf32") for trials in (1, 8, 32)),
    *(Case("4 x 1024, 300 px", PAPER_NETWORK, trials, "tf32") for trials in (1, 4, 8)),
]
ON_CPU = [Case("1 x 32, 16 px", SMALL, trials, "float32") for trials in (1, 4, 16)]

PHASE = 10  # prediction iterations between two looks at the clock
FIGURE3 = 320  # trials of the paper's Figure 3


class Traffic(TorchDispatchMode):
    """Counts the bytes that operations read and write, each as if nothing were kept in a cache or fused."""

    def __init__(self) -> None:
        """Nothing yet."""
        super().__init__()
        self.bytes = 0

    def __torch_dispatch__(self, function, types, arguments=(), options=None):
        """Do it, and count tensors unless it is a view."""
        made = function(*arguments, **(options or {}))
        if not function.is_view:
            flat, _ = torch.utils._pytree.tree_flatten((arguments, made))
            self.bytes += sum(
                one.numel() * one.element_size()
                for one in flat
                if isinstance(one, torch.Tensor)
            )
        return made


def settings(case: Case, phase: int = PHASE) -> Training:
    """The released preset's batch of 8 trajectories, and no test."""
    return Training(
        prediction_iterations=phase,
        test_interval=10**6,
        max_samples=10**9,
        precision=case.precision,
    )


def per_second(work: Callable[[], int], device: torch.device, seconds: float) -> float:
    """Units of work a second of wall-clock time, for about so long; `work` does some and returns how many."""

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
    """A bundle of trials that differ in their seeds."""
    sets, training = random_data(case.network.pixels), settings(case, phase)
    shelves = dict.fromkeys(ROLES, Shelf([sets.train], device))
    bundle = Bundle(shelves, case.network, training, ROLES, case.trials, device)
    for seed in range(case.trials):
        bundle.join(Seat(seed, Run(sets, training, seed), case.network, shelves))
    return bundle


def bundle_phase(bundle: Bundle) -> int:
    """A phase of prediction of a bundle, in samples."""
    bundle.predict_phase()
    training = bundle.training
    return (
        len(bundle.seats)
        * training.prediction_iterations
        * training.batch
        * bundle.shelves["novice"].steps
    )


def single(case: Case, device: torch.device) -> Callable[[], int]:
    """A phase of prediction of one training, in samples."""
    trainer = Trainer(
        random_data(case.network.pixels), case.network, settings(case), 0, device=device
    )

    def work() -> int:
        before = trainer.samples
        predict(trainer)
        return trainer.samples - before

    return work


def ceilings(device: torch.device) -> dict[str, float]:
    """Operations a second of matrix products by precision, and bytes a second of a copy."""
    size = 8192 if device.type == "cuda" else 1024
    found = {}
    for precision, kind in (
        ("float32", torch.float32),
        ("tf32", torch.float32),
        ("bfloat16", torch.bfloat16),
    ):
        left, right = torch.randn(2, size, size, device=device, dtype=kind)
        use(precision)
        found[precision] = per_second(
            lambda a=left, b=right: torch.mm(a, b).ndim * size**3, device, 1.0
        )
    source = torch.zeros(2**28 if device.type == "cuda" else 2**25, device=device)
    target = torch.zeros_like(source)
    found["copy"] = per_second(lambda: target.copy_(source).numel() * 8, device, 1.0)
    return found


def use(precision: str) -> None:
    """Whether products of float32 matrices may be rounded to TensorFloat-32."""
    torch.backends.cuda.matmul.allow_tf32 = torch.backends.cudnn.allow_tf32 = (
        precision == "tf32"
    )


def bytes_a_sample(case: Case) -> float:
    """What an iteration of a bundle of one reads and writes, by its operations."""
    alone = make_bundle(case._replace(trials=1), torch.device("cpu"), phase=1)
    with closing(alone) as bundle, Traffic() as counted:
        samples = bundle_phase(bundle)
    return counted.bytes / samples


def agreement(device: torch.device) -> float:
    """The largest relative difference of test losses between a bundle of 5 and 5 single trainings."""
    use("float32")
    sets = random_data(SMALL.pixels)
    training = Training(
        prediction_iterations=10, test_interval=5, max_samples=8 * 64 * 40
    )
    runs = [Run(sets, training, seed) for seed in range(5)]
    worst = 0.0
    for ended in train_bundle(runs, SMALL, 5, device):
        alone = train(sets, SMALL, training, ended.number, device=device)
        pairs = zip(ended.result.history, alone.history, strict=True)
        worst = max(
            worst,
            *(abs(mine.test_loss / theirs.test_loss - 1) for mine, theirs in pairs),
        )
    return worst


def measure(cases: Iterable[Case], device: torch.device, seconds: float) -> float:
    """Print a line a case; the most samples a second of the first network."""
    limits, first, best = ceilings(device), None, 0.0
    units = {name: "TB/s" if name == "copy" else "TFLOP/s" for name in limits}
    print(
        ", ".join(
            f"{name} {rate / 1e12:.3g} {units[name]}" for name, rate in limits.items()
        )
    )
    print(
        "network, precision, M: trial-iterations/s; samples/s; of products; of copies; x single; x released way"
    )
    rates: dict[Network, tuple[float, float, float, float]] = {}
    for case in cases:
        use(case.precision)
        if case.network not in rates:
            loop = ReleasedLoop(case.network.pixels, case.network, str(device))
            alone = per_second(single(case, device), device, seconds)
            each = operations(
                Trainer(
                    random_data(case.network.pixels),
                    case.network,
                    settings(case, phase=1),
                    0,
                )
            )
            rates[case.network] = (
                alone,
                per_second(loop.iterate, device, seconds),
                each,
                bytes_a_sample(case),
            )
        alone, released, each, moved = rates[case.network]
        with closing(make_bundle(case, device)) as bundle:
            found = per_second(functools.partial(bundle_phase, bundle), device, seconds)
        first = first or case.network
        best = max(best, found) if case.network == first else best
        print(
            f"{case.name}, {case.precision}, {case.trials:4d}: {found / 512:9.1f}; {found:11.0f}; "
            f"{found * each / limits[case.precision]:.3f}; {found * moved / limits['copy']:.3f}; "
            f"{found / alone:.2f}; {found / released:.2f}",
            flush=True,
        )
    return best


def main() -> None:
    """The table, and what it makes of Figure 3."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument(
        "--device", default="cuda" if torch.cuda.is_available() else "cpu"
    )
    parser.add_argument(
        "--seconds", type=float, default=8.0, help="of each measurement"
    )
    options = parser.parse_args()
    device = torch.device(options.device)
    gpu = device.type == "cuda"
    name = (
        torch.cuda.get_device_name(device)
        if gpu
        else f"{platform.machine()} CPU, SMALL SIZES, not a GPU"
    )
    versions = f"Python {platform.python_version()}, torch {torch.__version__}"
    print(
        f"# benchmarks/bundle.py on {name}, {torch.get_num_threads()} threads, {versions}"
    )
    print(
        f"test losses of a bundle of 5 and of 5 trainings alone differ by at most {agreement(device):.1e}, relative"
    )
    best = measure(ON_GPU if gpu else ON_CPU, device, options.seconds)
    if gpu:
        hours = [FIGURE3 * samples / best / 3600 for samples in (1e6, 20e6)]
        print(
            f"{FIGURE3} trials at the best rate, 1 and 20 million samples each: {hours[0]:.2f} h, {hours[1]:.1f} h"
        )


if __name__ == "__main__":
    main()
