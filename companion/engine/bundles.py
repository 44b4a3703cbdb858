"""Run trials in bundles: many trainings at once on one device, in this process."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import torch

from companion.bundle import SHARED, Run, train_bundle
from companion.engine.datasets import digests_of
from companion.engine.execute import stored_as
from companion.engine.library import Library
from companion.engine.outcomes import outcome_of
from companion.engine.pretrained import network_of, pretrained_folder, transferred
from companion.engine.provenance import record_provenance, source
from companion.engine.rows import Failure, Outcome, Row
from companion.trials import Trial
from ownrobot.methods import fine_tuning
from ownrobot.methods.fine_tuning import pretrained_from, pretraining_datasets
from sidm.body import ROVER
from sidm.drives import GroundError
from sidm.learning.checkpoint import CheckpointError
from sidm.learning.stopping import CurvePoint, TrainingError
from sidm.learning.training import Trained
from sidm.shards import ShardError


def _trainings(trial: Trial) -> list:
    """A trial's training, and its pretraining if it has one."""
    return [one for one in (trial.training, trial.pretraining) if one is not None]


def fits(trial: Trial) -> bool:
    """Whether a bundle can train the trial.

    A bundle trains networks of the paper's body whose systems share the SIDM alone,
    with the paper's adversary or without matching, and without the aids of some
    studies.
    """
    network, training = trial.network, trial.training
    plain = all(one.plain for one in _trainings(trial))
    trained = not trial.solved and not trial.residual and training.max_samples > 0
    rovers = network.body("novice") == network.body("expert") == ROVER
    return plain and trained and rovers and network.own == "all"


def bundles(trials: Iterable[Trial]) -> list[list[Trial]]:
    """Groups of trials that go together, in each the longest trainings first.

    All of them must fit. The trials of a group have one system, one network and one
    kind of training.
    """
    groups: dict[tuple, list[Trial]] = {}
    for trial in trials:
        shared = tuple(
            tuple(getattr(one, name) for name in SHARED) for one in _trainings(trial)
        )
        groups.setdefault((trial.system, trial.network, shared), []).append(trial)
    return [
        sorted(group, key=lambda t: (-t.training.max_samples, -t.novice_minutes))
        for group in groups.values()
    ]


def run_bundle(
    trials: Sequence[Trial],
    slots: int,
    data: str | Path,
    checkpoint: Callable[[Trial], Path],
    progress: Callable[[Trial, CurvePoint], None],
    device: str = "cpu",
    until: float = math.inf,
) -> Iterator[tuple[Trial, Row | Failure | Exception]]:
    """Train trials side by side, `slots` at a time, and evaluate each when it ends.

    The trials are a group of `bundles`. At `until`, a `time.monotonic()`, all states
    are written to the folders that `checkpoint` gives, and the rest is left for the
    next call.

    Yields:
        A trial and what is stored of it: its outcome is that of `execute.perform` but
        for rounding; or the error of a trial that failed, while the others go on.
    """
    source()  # as the work begins
    library = Library(data)

    def record(
        trial: Trial, result: Outcome | TrainingError, seconds: float, resumed: bool
    ) -> Row | Failure:
        threads = torch.get_num_threads()
        seen = digests_of(trial, library.data)
        made = record_provenance(
            seconds, threads, resumed, device, bundle=slots, digests=seen
        )
        return stored_as(trial, result, made)

    loadable = []
    for trial in trials:
        try:  # missing motion is known before hours of work
            library.rollouts(trial)
            library.datasets(trial)
        except (GroundError, ShardError) as error:
            yield trial, error
        else:
            loadable.append(trial)
    errors = _pretrain_missing(loadable, slots, library, device, until)
    runs, jobs = [], []
    for trial in loadable:
        start = None
        if trial.pretraining is not None:
            folder = pretrained_folder(trial, library.data, "bundle")
            failed = errors.get(folder)
            if isinstance(failed, TrainingError):
                yield trial, record(trial, failed, 0.0, False)
            elif failed is not None:
                yield trial, failed
            start = None if failed else fine_tuning.read(folder)
            if start is None:
                continue  # or its pretraining goes on in the next call
        state, sets = checkpoint(trial), library.datasets(trial)
        weights = transferred(trial, start).weights if start else None
        runs.append(Run(sets, trial.training, trial.seed, state, weights))
        jobs.append((trial, start.samples if start else 0, state.exists()))

    def tested(number: int, test: CurvePoint) -> None:
        progress(jobs[number][0], test)

    network = trials[0].network
    for number, ended, seconds in train_bundle(
        runs, network, slots, device, tested, until
    ):
        trial, samples, resumed = jobs[number]
        begun = time.perf_counter()
        result: Any
        try:
            result = ended
            if isinstance(ended, Trained):
                ended.model.to(device)
                result = outcome_of(trial, ended, library, samples)
        except Exception as error:  # one trial's failure must not lose the others
            result = error
        if isinstance(result, (Outcome, TrainingError)):
            seconds += time.perf_counter() - begun
            result = record(trial, result, seconds, resumed)
        yield trial, result


def _pretrain_missing(
    trials: Sequence[Trial], slots: int, library: Library, device: str, until: float
) -> dict[Path, Exception]:
    """Pretrain what trials start from and is not on disk, and keep the weights there.

    Returns:
        What went wrong, by folder. A pretraining that does not end in time is left.
    """
    errors: dict[Path, Exception] = {}
    missing: dict[Path, Run] = {}
    for trial in trials:
        if trial.pretraining is None:
            continue
        path = pretrained_folder(trial, library.data, "bundle")
        try:
            if fine_tuning.read(path) is None:
                sets = pretraining_datasets(library.datasets(trial), trial.seed)
                state = path / fine_tuning.STATE
                missing[path] = Run(sets, trial.pretraining, trial.seed, state)
        except CheckpointError as error:
            errors[path] = error
    if missing:
        folders, network = list(missing), network_of(trials[0])
        runs = list(missing.values())
        for number, ended, _ in train_bundle(runs, network, slots, device, until=until):
            if isinstance(ended, Trained):
                fine_tuning.write(folders[number], pretrained_from(ended))
            else:
                errors[folders[number]] = ended
    return errors
