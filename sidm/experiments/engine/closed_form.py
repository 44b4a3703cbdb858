"""Run any trial: by the training loop, as `measure` does it, or, where its weights have a closed form, by solving."""

from __future__ import annotations

import time
from pathlib import Path

from sidm.experiments.engine import execute as measure
from sidm.experiments.engine import provenance
from sidm.experiments.engine.execute import Library, Progress, evaluate, one_thread, stored_as
from sidm.experiments.engine.pretrained import start_of
from sidm.experiments.engine.provenance import THREADS
from sidm.experiments.engine.store import Failure, Outcome, Row
from sidm.experiments.trials import Trial
from sidm.learning.beyond.least_squares import fit
from sidm.learning.beyond.pretraining import Start
from sidm.learning.dataset import Datasets, Standardisation
from sidm.learning.model import DynamicsModel
from sidm.learning.training import Trained, TrainingError


def perform(
    trial: Trial,
    data: str | Path = "data",
    checkpoint: Path | None = None,
    progress: Progress | None = None,
    device: str = "cpu",
) -> tuple[Outcome, Trained]:
    """`measure.perform`; what is solved goes on from nothing, is done before it could show anything, on the CPU."""
    if not trial.solved:
        return measure.perform(trial, data, checkpoint, progress, device)
    with one_thread():
        library = Library(data)
        sets, rollouts = library.datasets(trial), library.rollouts(trial)
        start = start_of(trial, sets, data)
        solved = _solve(trial, sets, start)
        return evaluate(trial, solved, sets.validation, rollouts, start), solved


def _solve(trial: Trial, sets: Datasets, start: Start | None) -> Trained:
    """In the expert's units as every method, alone or on top of the expert's model."""
    assert sets.expert is not None
    units, base = Standardisation.of(sets.expert), None
    if start is not None:
        base = DynamicsModel(trial.network, units, roles=["novice"])
        base.start(start.weights)
        base.eval().requires_grad_(False)
    return fit(sets, units, base, trial.training.mirror)


def run_trial(
    trial: Trial,
    data: str | Path = "data",
    checkpoint: Path | None = None,
    progress: Progress | None = None,
    device: str = "cpu",
    log: str | Path | None = None,
) -> Row | Failure:
    """`perform` a trial and say where the outcome comes from, or how it failed, as `measure.run_trial` does."""
    if not trial.solved:
        return measure.run_trial(trial, data, checkpoint, progress, device, log)
    start = time.perf_counter()
    try:
        found: Outcome | TrainingError = perform(trial, data)[0]
    except TrainingError as error:  # of the pretraining
        found = error
    return stored_as(trial, found, provenance.here(time.perf_counter() - start, THREADS, kind="least_squares"))
