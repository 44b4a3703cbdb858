"""Run trials as bundles: many at once on one device, in this process."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import torch

from sidm.experiments import provenance
from sidm.experiments.measure import Library, evaluate, stored_as
from sidm.experiments.store import Failure, Outcome, Row
from sidm.experiments.trials import Trial
from sidm.learning.bundle import SHARED, Run, train_bundle
from sidm.learning.training import Tested, Trained, TrainingError


def bundles(trials: Iterable[Trial]) -> list[list[Trial]]:
    """The trials that can be trained side by side: of one system, network and kind of training; longest first."""
    groups: dict[tuple, list[Trial]] = {}
    for trial in trials:
        common = tuple(getattr(trial.training, name) for name in SHARED)
        groups.setdefault((trial.system, trial.network, common), []).append(trial)
    return [sorted(group, key=lambda trial: -trial.novice_minutes) for group in groups.values()]


def run_bundle(
    trials: Sequence[Trial],
    seats: int,
    data: str | Path = "data",
    checkpoint: Callable[[Trial], Path] | None = None,
    progress: Callable[[Trial, Tested], None] | None = None,
    device: str = "cpu",
) -> Iterator[Row | Failure]:
    """Train trials side by side, `seats` at a time, and evaluate each when it ends.

    Args:
        trials: those of one of `bundles`.
        seats: how many are trained at once.
        data: the folder of the shards.
        checkpoint: the folder of a trial, to go on from and to write to.
        progress: called after each test.
        device: where to compute.

    Yields:
        What is stored of a trial: its outcome is that of `measure.perform` but for rounding.

    Raises:
        ShardError: data that are missing, damaged, or not those of a trial; one line.
    """
    provenance.source_hash("bundle")  # of the code as it is now, not when the trials are done
    library = Library(data)
    folders = [checkpoint(trial) if checkpoint else None for trial in trials]
    resumed = [folder is not None and folder.exists() for folder in folders]
    runs = [
        Run(library.datasets(trial), trial.training, trial.seed, checkpoint=folder)
        for trial, folder in zip(trials, folders, strict=True)
    ]

    def tell(number: int, tested: Tested) -> None:
        if progress is not None:
            progress(trials[number], tested)

    for number, found, seconds in train_bundle(runs, trials[0].network, seats, device, tell):
        trial = trials[number]
        made = provenance.here(seconds, torch.get_num_threads(), resumed[number], device, bundle=seats)
        outcome = found if isinstance(found, TrainingError) else _outcome(trial, found, library, device)
        yield stored_as(trial, outcome, made)


def _outcome(trial: Trial, trained: Trained, library: Library, device: str) -> Outcome:
    trained.model.to(device)
    return evaluate(trial, trained, library.motion(trial, "validation"), library.trajectories(trial, "rollout"))
