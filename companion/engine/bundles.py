"""Run trials in bundles: many trainings at once on one device, in this process."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import torch

from companion.bundle import FIXED, SHARED, Run, train_bundle
from companion.engine import provenance
from companion.engine.datasets import digests_of
from companion.engine.execute import stored_as
from companion.engine.library import Library
from companion.engine.outcomes import outcome_of
from companion.engine.pretrained import network_of, pretrained_folder, transferred
from companion.engine.rows import Failure, Outcome, Row
from companion.trials import Trial
from ownrobot.methods import fine_tuning
from ownrobot.methods.fine_tuning import (
    STATE,
    Pretrained,
    pretrained_from,
    pretraining_datasets,
)
from sidm.config import ConfigError
from sidm.drives import GroundError
from sidm.learning.checkpoint import CheckpointError
from sidm.learning.training import CurvePoint, Trained, TrainingError
from sidm.shards import ShardError

#: Initial weights of a trial; None: random weights; or the error of its pretraining.
Starting = Pretrained | TrainingError | CheckpointError | None


def fits(trial: Trial) -> bool:
    """Whether a bundle can train the trial.

    A bundle trains networks whose systems share the SIDM alone, with the paper's
    adversary or without matching, and without the aids of some studies.
    """
    trainings = filter(None, (trial.training, trial.pretraining))
    plain = all(
        getattr(training, name) == value
        for training in trainings
        for name, value in FIXED.items()
    )
    gradients = not trial.solved and trial.training.max_samples > 0
    return plain and gradients and trial.network.own == "all" and not trial.residual


def bundles(trials: Iterable[Trial]) -> list[list[Trial]]:
    """Groups of trials that one bundle trains, in each the longest trainings first.

    The trials of a group have one system, one network and one kind of training.

    Raises:
        ConfigError: no bundle can train a trial's method.
    """
    groups: dict[tuple, list[Trial]] = {}
    for trial in trials:
        if not fits(trial):
            raise ConfigError(
                f"{trial}: this method cannot be trained in a bundle; train it alone"
            )
        trainings = filter(None, (trial.training, trial.pretraining))
        shared = tuple(
            tuple(getattr(training, name) for name in SHARED) for training in trainings
        )
        groups.setdefault((trial.system, trial.network, shared), []).append(trial)
    return [
        sorted(group, key=lambda t: (-t.training.max_samples, -t.novice_minutes))
        for group in groups.values()
    ]


class BundleCallbacks(NamedTuple):
    """What a bundle calls while it runs."""

    progress: Callable[[Trial, CurvePoint], None]  # after a test
    fault: Callable[[Trial, Exception], None]  # a trial failed; the others go on


def run_bundle(
    trials: Sequence[Trial],
    slots: int,
    data: str | Path,
    checkpoint: Callable[[Trial], Path],
    callbacks: BundleCallbacks,
    device: str = "cpu",
    until: float = math.inf,
) -> Iterator[Row | Failure]:
    """Train trials side by side, `slots` at a time, and evaluate each when it ends.

    Args:
        trials: one group of `bundles`.
        slots: how many are trained at once.
        data: the folder of the shards.
        checkpoint: the folder of a trial, to go on from and to write to.
        callbacks: called meanwhile.
        device: where to compute.
        until: `time.monotonic()` at which all states are written and the rest is left
            for the next call.

    Yields:
        What is stored of a trial: its outcome is that of `execute.perform` but for
        rounding.
    """
    provenance.source()  # as the work begins
    library = Library(data)

    def record(
        trial: Trial, result: Outcome | TrainingError, seconds: float, resumed: bool
    ) -> Row | Failure:
        threads = torch.get_num_threads()
        seen = digests_of(trial, library.data)
        made = provenance.here(
            seconds, threads, resumed, device, bundle=slots, digests=seen
        )
        return stored_as(trial, result, made)

    runs, run_starts = [], []
    loadable = _loadable(trials, library, callbacks)
    starts = _starts(loadable, slots, library, device, until)
    for trial in loadable:
        if trial.key not in starts:
            continue  # its pretraining goes on in the next call
        start = starts[trial.key]
        if isinstance(start, TrainingError):
            yield record(trial, start, 0.0, False)
        elif isinstance(start, Exception):
            callbacks.fault(trial, start)
        else:
            runs.append(_run_of(trial, start, library, checkpoint(trial)))
            run_starts.append((trial, start, checkpoint(trial).exists()))

    def tested(number: int, test: CurvePoint) -> None:
        callbacks.progress(run_starts[number][0], test)

    network = trials[0].network
    for number, ended, seconds in train_bundle(
        runs, network, slots, device, tested, until
    ):
        trial, start, resumed = run_starts[number]
        evaluation_start = time.perf_counter()
        try:
            result = _result(trial, ended, start, library, device)
        except Exception as error:  # one trial's failure must not lose the others
            callbacks.fault(trial, error)
        else:
            seconds += time.perf_counter() - evaluation_start
            yield record(trial, result, seconds, resumed)


def _loadable(
    trials: Sequence[Trial], library: Library, callbacks: BundleCallbacks
) -> list[Trial]:
    """The trials whose motion is on disk; known before hours of work."""
    loadable = []
    for trial in trials:
        try:
            library.rollouts(trial)
            library.datasets(trial)
        except (GroundError, ShardError) as error:
            callbacks.fault(trial, error)
        else:
            loadable.append(trial)
    return loadable


def _run_of(
    trial: Trial, start: Pretrained | None, library: Library, checkpoint: Path
) -> Run:
    sets = library.datasets(trial)
    run = Run(sets, trial.training, trial.seed, checkpoint=checkpoint)
    return run._replace(start=transferred(trial, start).weights) if start else run


def _result(
    trial: Trial,
    ended: Trained | TrainingError | CheckpointError,
    start: Pretrained | None,
    library: Library,
    device: str,
) -> Outcome | TrainingError:
    """The outcome of a training that ended; CheckpointError if it could not go on."""
    if isinstance(ended, CheckpointError):
        raise ended
    if isinstance(ended, TrainingError):
        return ended
    ended.model.to(device)
    return outcome_of(trial, ended, library, start.samples if start else 0)


def _starts(
    trials: Sequence[Trial], slots: int, library: Library, device: str, until: float
) -> dict[str, Starting]:
    """The weights that each trial starts from, by key; missing ones are pretrained.

    A trial whose pretraining does not end in time is left out.
    """
    folders = {
        trial: pretrained_folder(trial, library.data, "bundle")
        for trial in trials
        if trial.pretraining is not None
    }
    users = {path: trial for trial, path in folders.items()}  # one for each folder
    starts: dict[Path, Starting] = {}
    for path in users:
        try:
            if (start := fine_tuning.read(path)) is not None:
                starts[path] = start
        except CheckpointError as error:
            starts[path] = error
    missing = {path: trial for path, trial in users.items() if path not in starts}
    starts |= _pretrained(missing, slots, library, device, until)
    pretrained = {
        trial.key: starts[path] for trial, path in folders.items() if path in starts
    }
    fresh = {trial.key: None for trial in trials if trial.pretraining is None}
    return pretrained | fresh


def _pretrained(
    missing: dict[Path, Trial], slots: int, library: Library, device: str, until: float
) -> dict[Path, Starting]:
    """Pretrain for the trials, by folder, and keep the weights there."""
    folders = list(missing)
    runs = [
        Run(
            pretraining_datasets(library.datasets(trial), trial.seed),
            trial.pretraining,
            trial.seed,
            checkpoint=path / STATE,
        )
        for path, trial in missing.items()
        if trial.pretraining is not None
    ]
    if not runs:
        return {}
    starts: dict[Path, Starting] = {}
    network = network_of(missing[folders[0]])
    for number, ended, _ in train_bundle(runs, network, slots, device, until=until):
        path = folders[number]
        if isinstance(ended, Trained):
            starts[path] = start = pretrained_from(ended)
            fine_tuning.write(path, start)
        else:
            starts[path] = ended
    return starts
