"""Run one trial: load its motion, train it or solve for its weights, evaluate it."""

from __future__ import annotations

import time
from pathlib import Path

from companion.engine.datasets import digests_of
from companion.engine.library import Library
from companion.engine.outcomes import outcome_of
from companion.engine.pretrained import start_of
from companion.engine.provenance import THREADS, Provenance, record_provenance, source
from companion.engine.rows import Failure, Outcome, Row
from companion.extensions.residual import Corrected, correction_units, residual_datasets
from companion.extensions.trainer import mirror_image
from companion.numerics import version_label, versions
from companion.trials import Trial
from ownrobot.methods.fine_tuning import Pretrained, frozen_model
from ownrobot.methods.least_squares import fit
from sidm.config import replace
from sidm.learning import checkpoint as checkpoints
from sidm.learning.arithmetic import one_thread
from sidm.learning.dataset import Datasets
from sidm.learning.model import DynamicsModel, Predictor
from sidm.learning.stopping import TrainingError
from sidm.learning.trainer import Progress
from sidm.learning.training import Trained, train
from sidm.learning.units import Standardisation, default_units, loss_weights, role_units
from sidm.systems import find_system


def perform(
    trial: Trial,
    data: str | Path = "data",
    checkpoint: Path | None = None,
    progress: Progress | None = None,
    device: str = "cpu",
) -> tuple[Outcome, Trained]:
    """Train and evaluate one trial.

    Weights in closed form are solved on the CPU, without checkpoint and progress.

    Args:
        trial: what to run.
        data: the folder of the shards.
        checkpoint: a folder to go on from and to write the state to.
        progress: called after each test.
        device: where to compute, 'cpu' or 'cuda'; two kinds of device agree but for
            rounding.

    Returns:
        The outcome, a function of the trial and its data alone, and the trained model
        with its history.
    """
    with one_thread():
        library = Library(data)
        sets = library.datasets(trial)
        library.rollouts(trial)  # missing ones are known before hours of work
        start = start_of(trial, sets, data, "cpu" if trial.solved else device)
        if trial.solved:
            trained = _solve(trial, sets, start)
        else:
            trained = _train(trial, sets, start, checkpoint, progress, device)
        outcome = outcome_of(trial, trained, library, start.samples if start else 0)
    return outcome, trained


def _train(
    trial: Trial,
    sets: Datasets,
    start: Pretrained | None,
    checkpoint: Path | None,
    progress: Progress | None,
    device: str,
) -> Trained:
    """Train the trial's model, or a correction of the pretrained model."""
    base, weights, units = None, start.weights if start else None, None
    if start is not None and trial.residual:
        base, weights = _frozen(trial, sets, start).to(device), None
        sets = residual_datasets(sets, base)
        units = correction_units(sets)
    trained = train(
        sets,
        trial.network,
        trial.training,
        trial.seed,
        start=weights,
        standardisation=units,
        checkpoint=checkpoint,
        progress=progress,
        device=device,
    )
    if base is None:
        return trained
    return trained._replace(model=Corrected(base, trained.model))


def _solve(trial: Trial, sets: Datasets, start: Pretrained | None) -> Trained:
    """Least squares in the units of every method, alone or on the expert's model."""
    base = None if start is None else _frozen(trial, sets, start)
    body = trial.network.body("novice")
    units = role_units(default_units(sets, trial.network), "novice")
    image = mirror_image if trial.training.mirror else None
    return fit(sets, units, base, image, loss_weights(body, units))


def _frozen(trial: Trial, sets: Datasets, start: Pretrained) -> DynamicsModel:
    assert sets.expert is not None
    return frozen_model(trial.network, start, Standardisation.fit(sets.expert))


def run_trial(
    trial: Trial,
    data: str | Path = "data",
    checkpoint: Path | None = None,
    progress: Progress | None = None,
    device: str = "cpu",
) -> Row | Failure:
    """Run a trial and return its row, or its failure, with the provenance."""
    source()  # as the work begins
    resumed = checkpoint is not None and checkpoint.exists()
    begun = time.perf_counter()
    result: Outcome | TrainingError
    try:
        result, _ = perform(trial, data, checkpoint, progress, device)
    except TrainingError as error:
        result = error
    made = record_provenance(
        time.perf_counter() - begun,
        THREADS,
        resumed,
        device="cpu" if trial.solved else device,
        kind="least_squares" if trial.solved else "training",
        digests=digests_of(trial, data),
    )
    return stored_as(trial, result, made)


def stored_as(
    trial: Trial, result: Outcome | TrainingError, made: Provenance
) -> Row | Failure:
    """The record of a trial's result.

    A trial on robots with free struts depends on the version of that motion, too.
    """
    if not find_system(trial.system).physics.strut_motors:
        made = replace(made, numerics=versions("free_struts") | made.numerics)
    if isinstance(result, TrainingError):
        return Failure(
            trial=trial,
            what=result.kind,
            loss=str(result.loss),
            iteration=result.iteration,
            provenance=made,
        )
    return Row(trial=trial, outcome=result, provenance=made)


def predictor_of(trial: Trial, data: str | Path = "data") -> Predictor:
    """The model with which a trial predicts the novice.

    Networks are kept by `model_of`. Weights in closed form are solved again each time,
    which is faster than keeping them is worth.
    """
    return perform(trial, data)[1].model if trial.solved else model_of(trial, data)


def model_of(trial: Trial, data: str | Path = "data") -> DynamicsModel:
    """The novice's parts of a trial's network, trained once and kept under `data`."""
    folder = Path(data) / "models" / f"{trial.key}-{version_label('training')}"
    state = checkpoints.read(folder)
    if state is None:
        tensors = perform(trial, data)[1].model.state_dict()
        novice = {name: t for name, t in tensors.items() if ".expert." not in name}
        checkpoints.write(folder, novice, {})
        state = checkpoints.read(folder)
        assert state is not None
    model = DynamicsModel(trial.network, roles=["novice"])
    model.initialise_from(state[0])
    return model.eval()
