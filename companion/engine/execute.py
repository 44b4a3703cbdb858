"""Run one trial: load its data, train it or solve for its weights, validate, roll out."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch

from companion.beyond.mirror import mirror_image
from companion.engine import provenance
from companion.engine.datasets import load_dataset
from companion.engine.event_log import EventLog
from companion.engine.pretrained import start_of
from companion.engine.provenance import THREADS, Provenance
from companion.engine.store import Failure, Outcome, Row
from companion.numerics import versions
from companion.trials import Dataset, Trial
from sidm.body import ROVER, Body
from sidm.drives import Drive
from sidm.learning.arithmetic import one_thread
from sidm.learning.dataset import Datasets, Windows, load_windows, novice_split
from sidm.learning.evaluation import rollout, rollout_errors, validation_loss
from sidm.learning.model import DynamicsModel, Predictor
from sidm.learning.observation import seen_as
from sidm.learning.training import Tested, Trained, TrainingError, train
from sidm.learning.units import Standardisation, loss_weights, units_for, units_of
from sidm.rivals.fine_tuning import Start, frozen
from sidm.rivals.least_squares import fit
from sidm.rivals.residual import Corrected, left_over, units
from sidm.shards import simulated_ground
from sidm.systems import find_system

ROLLOUT_STEPS = 25  # control steps of Figure 4's rollouts, 2.5 s
CURVE_POINTS = 40  # at most, of the learning curve's summary
ROLLOUTS_KEPT = 3  # whole, for pictures

Progress = Callable[[Tested], None]  # called after each test


def load_checked(
    dataset: Dataset, digest: str, data: str | Path, pixels: int, body: Body = ROVER
) -> Windows:
    """The motion of a dataset; ShardError when it is missing, damaged, or of another digest."""
    load_dataset(dataset, digest, data)
    terrain = find_system(dataset.collection.system).terrain
    return load_windows(data, dataset.collection, dataset.count, terrain, pixels, body)


class Library:
    """The data under a folder as trials need them, each held against the trial's digest and loaded once."""

    def __init__(self, data: str | Path = "data"):
        self.data = Path(data)
        self._rollouts: dict[tuple, list[Drive]] = {}
        self._motions: dict[tuple, Windows] = {}

    def rollouts(self, trial: Trial) -> list[Drive]:
        """The trajectories of the 25-step test; ShardError as in `motion`."""
        key = trial.datasets["rollout"], trial.digests["rollout"]
        if key not in self._rollouts:
            self._rollouts[key] = load_dataset(*key, self.data)
        return self._rollouts[key]

    def motion(self, trial: Trial, kind: str) -> Windows:
        """One of the trial's datasets; ShardError when it is missing, damaged, or not that of the trial."""
        dataset, pixels = trial.datasets[kind], trial.network.pixels
        body = trial.network.body(dataset.collection.role)
        key = dataset, trial.digests[kind], pixels, body
        if key not in self._motions:
            self._motions[key] = load_checked(
                dataset, trial.digests[kind], self.data, pixels, body
            )
        return self._motions[key]

    def datasets(self, trial: Trial) -> Datasets:
        """What the trial learns from and is judged by."""
        pool, validation, expert = (
            self.motion(trial, kind) for kind in ("novice", "validation", "expert")
        )
        train_part, test_part = novice_split(
            len(pool), trial.novice_minutes, trial.seed
        )
        return Datasets(
            pool.subset(train_part), pool.subset(test_part), validation, expert
        )


def perform(
    trial: Trial,
    data: str | Path = "data",
    checkpoint: Path | None = None,
    progress: Progress | None = None,
    device: str = "cpu",
) -> tuple[Outcome, Trained]:
    """Train and evaluate one trial; one that is solved knows neither checkpoint nor progress, and is on the CPU.

    Args:
        trial: what to run.
        data: the folder of the shards.
        checkpoint: a folder to go on from and to write the state to.
        progress: called after each test.
        device: where to compute, 'cpu' or 'cuda'; two kinds of device agree but for
            rounding.

    Returns:
        The outcome, a pure function of the trial and its data, and the trained model
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
            trained = _train(
                trial,
                sets,
                start,
                checkpoint=checkpoint,
                progress=progress,
                device=device,
            )
        return evaluate(trial, trained, library, start), trained


def _train(trial: Trial, sets: Datasets, start: Start | None, **how: Any) -> Trained:
    """`train` a trial's model from what it starts from, or as a correction of it."""
    if start is None or not trial.residual:
        return train(
            sets,
            trial.network,
            trial.training,
            trial.seed,
            start=start and start.weights,
            **how,
        )
    base = _frozen(trial, sets, start).to(how["device"])
    sets = left_over(sets, base)
    trained = train(
        sets,
        trial.network,
        trial.training,
        trial.seed,
        standardisation=units(sets),
        **how,
    )
    return trained._replace(model=Corrected(base, trained.model))


def _solve(trial: Trial, sets: Datasets, start: Start | None) -> Trained:
    """Least squares in the units of every method, alone or on top of the expert's model."""
    base = None if start is None else _frozen(trial, sets, start)
    body, units = (
        trial.network.body("novice"),
        units_for(units_of(sets, trial.network), "novice"),
    )
    return fit(
        sets,
        units,
        base,
        mirror_image if trial.training.mirror else None,
        loss_weights(body, units),
    )


def _frozen(trial: Trial, sets: Datasets, start: Start) -> DynamicsModel:
    assert sets.expert is not None
    return frozen(trial.network, start, Standardisation.of(sets.expert))


class Judged(NamedTuple):
    """How good a model is: means over the validation set, and over the R rollouts of K steps."""

    losses: torch.Tensor  # (Y,) the terms of equation (1)
    position: torch.Tensor  # (K,) m
    heading: torch.Tensor  # (K,) rad
    predicted: torch.Tensor  # (R, K + 1, S) states
    actual: torch.Tensor  # (R, K + 1, S)


def judge(model: Predictor, trial: Trial, library: Library) -> Judged:
    """A model of a trial's novice on the trial's validation set and rollouts, where the model is.

    Where the body's loss is in units of the variance, they are the validation set's:
    the same for every seed and size.
    """
    body, motion = trial.network.body("novice"), library.motion(trial, "validation")
    losses = validation_loss(
        model,
        motion,
        weights=loss_weights(body, Standardisation.of(motion, maps_from=1)),
    )
    predicted, actual = roll_out(model, trial, library.rollouts(trial))
    position, heading = rollout_errors(predicted, actual, body)
    return Judged(losses, position.mean(0), heading.mean(0), predicted, actual)


def evaluate(
    trial: Trial, trained: Trained, library: Library, start: Start | None = None
) -> Outcome:
    """The outcome of a trained model; `start` is what it was trained from."""
    losses, position, heading, predicted, actual = judge(trained.model, trial, library)
    return Outcome(
        validation_loss=float(losses.sum()),
        component_losses=plain(losses),
        best_test_loss=float(trained.best_test_loss),
        position_error=plain(position),
        heading_error=plain(heading),
        example_predicted=plain(predicted[0, :, :2]),
        example_actual=plain(actual[0, :, :2]),
        **curve(trained),
        **every_test(trained),
        iterations=trained.iterations,
        samples=trained.samples,
        pretraining_samples=start.samples if start else 0,
        component_samples=tuple(one.samples for one in trained.components),
        component_test=tuple(one.test for one in trained.components),
        component_validation=tuple(one.validation for one in trained.components),
        rollouts_predicted=plain(predicted[:ROLLOUTS_KEPT]),
        rollouts_actual=plain(actual[:ROLLOUTS_KEPT]),
    )


def run_trial(
    trial: Trial,
    data: str | Path = "data",
    checkpoint: Path | None = None,
    progress: Progress | None = None,
    device: str = "cpu",
    log: str | Path | None = None,
) -> Row | Failure:
    """`perform` a trial and say where the outcome comes from, or how it failed; event files go to the folder `log`."""
    provenance.source()  # as the work begins
    resumed, start = checkpoint is not None and checkpoint.exists(), time.perf_counter()
    try:
        with EventLog(log) as events:
            tell = events.progress(trial, also=progress)
            found: Outcome | TrainingError = perform(
                trial, data, checkpoint, tell, device
            )[0]
    except TrainingError as error:
        found = error
    seconds, kind = (
        time.perf_counter() - start,
        "least_squares" if trial.solved else "training",
    )
    where = "cpu" if trial.solved else device
    return stored_as(
        trial, found, provenance.here(seconds, THREADS, resumed, where, kind=kind)
    )


def stored_as(
    trial: Trial, found: Outcome | TrainingError, made: Provenance
) -> Row | Failure:
    """What the store keeps of a trial; one whose motion has a version of its own depends on it."""
    if not find_system(trial.system).physics.strut_motors:
        made = dataclasses.replace(
            made, numerics=versions("free_struts") | made.numerics
        )  # type: ignore[type-var]
    if isinstance(found, TrainingError):
        return Failure(
            trial=trial,
            what=found.what,
            loss=str(found.loss),
            iteration=found.iteration,
            provenance=made,
        )
    return Row(trial=trial, outcome=found, provenance=made)


def roll_out(
    model: Predictor, trial: Trial, drives: list[Drive]
) -> tuple[torch.Tensor, torch.Tensor]:
    """Predicted and actual states, each (B, K + 1, S), of drives under their own actions; K = ROLLOUT_STEPS."""
    spacing, body = (
        find_system(trial.system).terrain.spacing,
        trial.network.body("novice"),
    )
    heights = torch.tensor(
        np.stack([simulated_ground(drive).heights for drive in drives])
    )
    states = torch.tensor(
        np.stack([drive.states[: ROLLOUT_STEPS + 1] for drive in drives])
    )
    actions = torch.tensor(
        np.stack([drive.actions[:ROLLOUT_STEPS] for drive in drives])
    )
    last = actions[:, -1:]  # stands behind the last state, where no action is
    states, actions = seen_as(body, states, torch.cat([actions, last], 1))
    path = rollout(
        model,
        heights,
        states[:, 0],
        actions[:, :-1],
        trial.network.pixels,
        spacing=spacing,
        body=body,
    )
    return path, states


def curve(trained: Trained) -> dict[str, Any]:
    """The learning curve's summary at up to CURVE_POINTS even steps, first and last included, as a record has it."""
    count = len(trained.history)
    chosen = np.unique(
        np.linspace(0, count - 1, min(count, CURVE_POINTS)).round().astype(int)
    )
    tests = [trained.history[number] for number in chosen]
    return {
        f"curve_{name}": tuple(getattr(test, name) for test in tests)
        for name in ("samples", "test_loss", "training_loss")
    }


def every_test(trained: Trained) -> dict[str, Any]:
    """All tests of a training, as a record has them; none of one that took a single test, or measured less."""
    history = trained.history
    if len(history) < 2 or any(test.validation_loss is None for test in history):
        return {}
    losses = {
        f"every_{name}": tuple(getattr(test, name) for test in history)
        for name in ("training_loss", "test_loss", "validation_loss")
    }
    return {"test_spacing": history[0].samples} | losses


def plain(values: torch.Tensor) -> Any:
    """A tensor as nested lists, which a record takes for its tuples."""
    return values.tolist()
