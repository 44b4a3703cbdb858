"""Many trials on one device at once, from fresh weights to their ends: one that is over leaves its seat to another."""

from __future__ import annotations

import contextlib
import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import torch

from companion.bundle.bundle import Bundle
from companion.bundle.seat import Run, Seat
from companion.bundle.shelf import Shelf
from sidm.body import ROVER
from sidm.config import ConfigError
from sidm.learning.arithmetic import matmul_precision
from sidm.learning.checkpoint import CheckpointError
from sidm.learning.stopping import Tested, TrainingError
from sidm.learning.training import Trained, result
from sidm.settings import Network
from sidm.systems import ROLES

#: What the trials of a bundle have in common; they may differ in all other settings.
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

#: What a bundle cannot vary: the settings' only values in it.
ONLY = {"matching": "adversary", "tether": 0.0, "averaging": 0.0, "mirror": False}

SAVE_INTERVAL = 600.0  # s between two writings of all checkpoints
#: the bundle is made smaller when one of so many seats is empty and no trial waits
SHRINK = 8


class Ended(NamedTuple):
    """A trial of a bundle that is over."""

    number: int  # among the runs
    #: an error where a loss was not finite or it could not go on
    result: Trained | TrainingError | CheckpointError
    seconds: float  # its share of the time that the bundle took


def train_bundle(
    runs: Sequence[Run],
    network: Network,
    seats: int,
    device: str | torch.device = "cpu",
    progress: Callable[[int, Tested], None] | None = None,
    until: float = math.inf,
) -> Iterator[Ended]:
    """Train many trials side by side, `seats` at a time; a trial that ends makes room for the next.

    Each gives what `train` gives, but for rounding.

    Args:
        runs: the trials, in the order in which they are seated: the longest first
            leaves the fewest seats empty.
        network: sizes of the networks of all.
        seats: M, how many are trained at once.
        device: where to compute.
        progress: called after each test with the trial's number among `runs`.
        until: `time.monotonic()` at which the states of all are written and those that
            have not ended are left.

    Yields:
        What a trial came to, as soon as it ends.

    Raises:
        ConfigError: settings in which the trials of a bundle may not differ, data of
            unlike shapes, or more trials than the device's memory holds.
    """
    check_shared(runs, network)
    if not runs:
        return
    training, needs_expert = (
        runs[0].training,
        any(run.training.needs_expert for run in runs),
    )
    roles, device = ROLES if needs_expert else ROLES[:1], torch.device(device)
    shelves = shelves_of(runs, network, roles, device)
    waiting = deque(enumerate(runs))
    seats = min(seats, len(runs))
    with matmul_precision(training.precision), enough_memory(device, seats):
        bundle = Bundle(shelves, network, training, roles, seats, device)
        yield from _train(bundle, waiting, progress, until)


@contextlib.contextmanager
def enough_memory(device: torch.device, trials: int) -> Iterator[None]:
    """ConfigError in place of PyTorch's report when the device's memory does not hold so many trials."""
    try:
        yield
    except torch.OutOfMemoryError:
        what = f"{trials} trials side by side; choose a smaller bundle"
        one = "the trial; choose smaller networks or maps"
        raise ConfigError(
            f"the memory of {device} does not hold {what if trials > 1 else one}"
        ) from None


def _train(
    bundle: Bundle,
    waiting: deque[tuple[int, Run]],
    progress: Callable[[int, Tested], None] | None,
    until: float,
) -> Iterator[Ended]:
    """Seat those who wait and train until nobody is left, or the time is up."""
    saved = time.monotonic()
    try:
        while waiting or bundle.taken:
            while waiting and None in bundle.seats:
                number, run = waiting.popleft()
                try:
                    bundle.join(Seat(number, run, bundle.network, bundle.shelves))
                except CheckpointError as error:
                    yield Ended(number, error, 0.0)
            bundle.timed_phase(progress)
            for index in [index for index, seat in bundle.taken.items() if seat.over]:
                seat = bundle.leave(index)
                yield Ended(
                    seat.number, seat.error or result(seat.trainer), seat.seconds
                )
            late = time.monotonic() >= until
            if late or time.monotonic() - saved > SAVE_INTERVAL:
                bundle.save()
                saved = time.monotonic()
            if late:
                return
            if (
                not waiting
                and bundle.taken
                and bundle.seats.count(None) * SHRINK >= len(bundle.seats)
            ):
                bundle = bundle.shrunk()
    finally:
        bundle.close()


def shelves_of(
    runs: Sequence[Run], network: Network, roles: Sequence[str], device: torch.device
) -> dict[str, Shelf]:
    """The data of each system; on one shelf where both have the paper's body, and so the same shapes and units."""
    novice = [
        motion
        for run in runs
        for motion in (run.datasets.train, run.datasets.test, run.datasets.validation)
    ]
    if len(roles) == 1:
        return {"novice": Shelf(novice, device)}
    expert = [run.datasets.expert for run in runs if run.datasets.expert is not None]
    if network.body("novice") == network.body("expert") == ROVER:
        return dict.fromkeys(roles, Shelf([*novice, *expert], device))
    return {"novice": Shelf(novice, device), "expert": Shelf(expert, device)}


def check_shared(runs: Sequence[Run], network: Network) -> None:
    """ConfigError naming the first setting that a bundle cannot vary, or in which its trials may not differ."""
    if network.own != "all":
        raise ConfigError(
            f"Network.own={network.own!r} cannot be trained in a bundle; train it alone"
        )
    for name, only in ONLY.items():
        for run in runs:
            if (value := getattr(run.training, name, only)) != only:
                raise ConfigError(
                    f"Training.{name}={value!r} cannot be trained in a bundle; train it alone"
                )
    for name in SHARED:
        values = sorted({str(getattr(run.training, name)) for run in runs})
        if len(values) > 1:
            raise ConfigError(
                f"the trials of a bundle must have one Training.{name}, not {' and '.join(values)}"
            )
