"""Train many trials on one device, bundle after bundle."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import torch

from companion.bundle.bundle import Bundle, Progress
from companion.bundle.bundled_trial import BundledTrial, Run
from companion.bundle.device_data import DeviceData
from sidm.config import ConfigError
from sidm.learning.arithmetic import matmul_precision
from sidm.learning.checkpoint import CheckpointError
from sidm.learning.stopping import TrainingError
from sidm.learning.training import Trained, result
from sidm.settings import Network

#: Settings of training that all trials of a bundle share; all others may differ.
SHARED = (
    "batch",
    "discriminator_batch",
    "matching_batch",
    "prediction_iterations",
    "discriminator_iterations",
    "matching_iterations",
    "test_interval",
    "decay",
    "matching_optimiser",
    "reduction",
    "precision",
    "zero_gradients",
    "discriminator_draw",
)

SAVE_INTERVAL = 600.0  # s between two saves of all checkpoints


class Ended(NamedTuple):
    """A trial of a bundle that has ended."""

    number: int  # of the trial among the runs
    #: an error if a loss was not finite, or if the trial could not be resumed
    result: Trained | TrainingError | CheckpointError
    seconds: float  # this trial's share of the bundle's time


def train_bundle(
    runs: Sequence[Run],
    network: Network,
    slots: int,
    device: str | torch.device = "cpu",
    progress: Progress | None = None,
    until: float = math.inf,
) -> Iterator[Ended]:
    """Train many trials, `slots` of them at a time.

    A bundle ends with its last trial. Each trial has the result that `train` gives,
    apart from rounding. `engine.bundles` has trials that go together; others would
    have wrong results.

    Args:
        runs: the trials, in the order in which they begin. The longest first leaves the
            fewest slots empty.
        network: sizes of all networks.
        slots: M, how many trials are trained at once.
        device: where to compute.
        progress: called after each test with the trial's number among `runs`.
        until: value of `time.monotonic()` at which training stops: checkpoints are
            written, and trials that have not ended are left out.

    Yields:
        Each trial's result, as soon as the trial ends.

    Raises:
        ConfigError: the trials' data differ in shape, or the device has too little
            memory.
    """
    if not runs:
        return
    device, saved = torch.device(device), time.monotonic()
    slots = min(slots, len(runs))
    with matmul_precision(runs[0].training.precision), enough_memory(device, slots):
        data = device_data(runs, device)
        for first in range(0, len(runs), slots):
            trials: list[BundledTrial] = []
            for number in range(first, min(first + slots, len(runs))):
                try:
                    trials.append(BundledTrial(number, runs[number], network, data))
                except CheckpointError as error:
                    yield Ended(number, error, 0.0)
            if not trials:
                continue
            left = dict(enumerate(trials))
            with contextlib.closing(Bundle(trials, data, device)) as bundle:
                while left:
                    bundle.phase(progress)
                    for place in [place for place, one in left.items() if one.ended]:
                        trial = left.pop(place)
                        bundle.hand_back(place)
                        trained = trial.error or result(trial.trainer)
                        yield Ended(trial.number, trained, trial.seconds)
                    late = time.monotonic() >= until
                    if late or time.monotonic() - saved > SAVE_INTERVAL:
                        bundle.save()
                        saved = time.monotonic()
                    if late:
                        return


@contextlib.contextmanager
def enough_memory(device: torch.device, trials: int) -> Iterator[None]:
    """Raise a ConfigError of one line where PyTorch runs out of memory in the block."""
    try:
        yield
    except torch.OutOfMemoryError:
        advice = (
            f"{trials} trials side by side; choose a smaller bundle"
            if trials > 1
            else "the trial; choose smaller networks or maps"
        )
        raise ConfigError(f"the memory of {device} does not hold {advice}") from None


def device_data(runs: Sequence[Run], device: torch.device) -> DeviceData:
    """All trajectories that the runs learn from and test on, on the device."""
    needs_expert = any(run.training.needs_expert for run in runs)
    parts = [
        windows
        for run in runs
        for windows in (run.datasets if needs_expert else run.datasets[:3])
        if windows is not None
    ]
    return DeviceData(parts, device)
