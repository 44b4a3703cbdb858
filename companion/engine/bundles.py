"""Run trials as bundles: many at once on one device, in this process."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import torch

from companion.bundle import ONLY, SHARED, Run, train_bundle
from companion.engine import provenance
from companion.engine.execute import Library, evaluate, stored_as
from companion.engine.pretrained import carried, folder, network_of
from companion.engine.store import Failure, Outcome, Row
from companion.trials import Trial
from sidm.config import ConfigError
from sidm.drives import GroundError
from sidm.learning.checkpoint import CheckpointError
from sidm.learning.training import Tested, Trained, TrainingError
from sidm.rivals import fine_tuning
from sidm.rivals.fine_tuning import STATE, Start, expert_in_place, start_from
from sidm.shards import ShardError


def fits(trial: Trial) -> bool:
    """Whether a bundle can train it: parts of their own, the paper's adversary or none, and no aids."""
    trainings = [
        training
        for training in (trial.training, trial.pretraining)
        if training is not None
    ]
    plain = all(
        getattr(training, name) == only
        for training in trainings
        for name, only in ONLY.items()
    )
    gradients = not trial.solved and trial.training.max_samples > 0
    return plain and gradients and trial.network.own == "all" and not trial.residual


def bundles(trials: Iterable[Trial]) -> list[list[Trial]]:
    """The trials that can be trained side by side: of one system, network and kind of training; longest first.

    Raises:
        ConfigError: a trial's method cannot be trained so.
    """
    groups: dict[tuple, list[Trial]] = {}
    for trial in trials:
        if not fits(trial):
            raise ConfigError(
                f"{trial}: this method cannot be trained in a bundle; train it alone"
            )
        trainings = (trial.training, trial.pretraining)
        common = tuple(
            tuple(getattr(training, name) for name in SHARED)
            for training in trainings
            if training
        )
        groups.setdefault((trial.system, trial.network, common), []).append(trial)
    return [
        sorted(group, key=lambda trial: -trial.novice_minutes)
        for group in groups.values()
    ]


class Hooks(NamedTuple):
    """What a bundle tells those who run it."""

    progress: Callable[[Trial, Tested], None]  # a test was taken
    #: a trial could not be run or evaluated; the others go on
    fault: Callable[[Trial, Exception], None]


def run_bundle(
    trials: Sequence[Trial],
    seats: int,
    data: str | Path,
    checkpoint: Callable[[Trial], Path],
    hooks: Hooks,
    device: str = "cpu",
    until: float = math.inf,
) -> Iterator[Row | Failure]:
    """Train trials side by side, `seats` at a time, and evaluate each when it ends.

    Args:
        trials: those of one of `bundles`.
        seats: how many are trained at once.
        data: the folder of the shards.
        checkpoint: the folder of a trial, to go on from and to write to.
        hooks: what is told of them meanwhile.
        device: where to compute.
        until: `time.monotonic()` at which all states are written and the rest is left
            for the next call.

    Yields:
        What is stored of a trial: its outcome is that of `execute.perform` but for
        rounding.
    """
    provenance.source()  # as the work begins
    library, ready = Library(data), []
    for trial in trials:
        try:
            library.rollouts(trial)  # missing ones are known before hours of work
            library.datasets(trial)
        except (GroundError, ShardError) as error:
            hooks.fault(trial, error)
        else:
            ready.append(trial)
    starts, going, runs = _starts(ready, seats, data, library, device, until), [], []
    for trial in ready:
        if trial.key not in starts:
            continue  # its pretraining goes on next time
        given = starts[trial.key]
        if isinstance(given, TrainingError):
            made = provenance.here(
                0.0, torch.get_num_threads(), False, device, bundle=seats
            )
            yield stored_as(trial, given, made)
        elif isinstance(given, Exception):
            hooks.fault(trial, given)
        else:
            run = Run(
                library.datasets(trial),
                trial.training,
                trial.seed,
                checkpoint=checkpoint(trial),
            )
            runs.append(
                run._replace(start=carried(trial, given).weights) if given else run
            )
            going.append((trial, given))
    ready = [trial for trial, _ in going]
    resumed = [checkpoint(trial).exists() for trial in ready]
    for number, found, seconds in train_bundle(
        runs,
        trials[0].network,
        seats,
        device,
        lambda number, tested: hooks.progress(ready[number], tested),
        until,
    ):
        (trial, given), start = going[number], time.perf_counter()
        try:
            if isinstance(found, CheckpointError):
                raise found
            if isinstance(found, Trained):
                found.model.to(device)
                outcome: Outcome | TrainingError = evaluate(
                    trial, found, library, given
                )
            else:
                outcome = found
        except Exception as error:  # one trial's failure must not lose the others
            hooks.fault(trial, error)
        else:
            seconds += time.perf_counter() - start
            made = provenance.here(
                seconds, torch.get_num_threads(), resumed[number], device, bundle=seats
            )
            yield stored_as(trial, outcome, made)


def _starts(
    trials: Sequence[Trial],
    seats: int,
    data: str | Path,
    library: Library,
    device: str,
    until: float,
) -> dict[str, Start | TrainingError | CheckpointError | None]:
    """By key, the weights that each trial starts from, or why there are none; made, side by side, where they lack.

    Those whose pretraining does not end in time are left out.
    """
    users = {
        folder(trial, data, "bundle"): trial
        for trial in trials
        if trial.pretraining is not None
    }
    # one for all its users
    kept: dict[Path, Start | TrainingError | CheckpointError] = {}
    for where in users:
        try:
            if (start := fine_tuning.read(where)) is not None:
                kept[where] = start
        except CheckpointError as error:
            kept[where] = error
    lacking = {where: trial for where, trial in users.items() if where not in kept}
    kept |= _pretrained(lacking, seats, library, device, until)
    found: dict[str, Start | TrainingError | CheckpointError | None] = {}
    for trial in trials:
        if trial.pretraining is None:
            found[trial.key] = None
        elif (where := folder(trial, data, "bundle")) in kept:
            found[trial.key] = kept[where]
    return found


def _pretrained(
    lacking: dict[Path, Trial], seats: int, library: Library, device: str, until: float
) -> dict[Path, Start | TrainingError | CheckpointError]:
    """By folder, the weights of its trial's pretraining, made and kept there, or why there are none."""
    runs = [
        Run(
            expert_in_place(library.datasets(one), one.seed),
            one.pretraining,
            one.seed,
            checkpoint=where / STATE,
        )
        for where, one in lacking.items()
        if one.pretraining is not None
    ]
    folders, made = list(lacking), {}
    if not runs:
        return {}
    for number, found, _ in train_bundle(
        runs, network_of(lacking[folders[0]]), seats, device, until=until
    ):
        where = folders[number]
        made[where] = start_from(found) if isinstance(found, Trained) else found
        if isinstance(found, Trained):
            fine_tuning.keep(where, start_from(found))
    return made
