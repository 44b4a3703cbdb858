"""How good a trial's model is: its losses, its rollouts, and its learning curve."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from companion.bodies import seen_by
from companion.engine.library import Library
from companion.engine.rows import Outcome
from companion.trials import Trial
from sidm.learning.evaluation import rollout, rollout_errors, validation_loss
from sidm.learning.model import Predictor
from sidm.learning.training import Trained
from sidm.learning.units import Standardisation, loss_weights
from sidm.systems import find_system

ROLLOUT_STEPS = 25  # control steps of Figure 4's rollouts, 2.5 s
CURVE_POINTS = 40  # most points of the learning curve's summary
ROLLOUTS_KEPT = 3  # rollouts whose states are stored, for pictures


class Evaluation(NamedTuple):
    """A model's losses on the validation set, and its R rollouts of K steps."""

    losses: Tensor  # (Y,) summands of equation (1), mean over the validation set
    position: Tensor  # (K,) m, error, mean over the rollouts
    heading: Tensor  # (K,) rad, error, mean over the rollouts
    predicted: Tensor  # (R, K + 1, S) states
    actual: Tensor  # (R, K + 1, S) states


def evaluate(model: Predictor, trial: Trial, library: Library) -> Evaluation:
    """Evaluate a model of the novice on the trial's validation set and rollouts.

    Where the robot's body asks for a loss in units of the variance, it is the variance
    of the validation set: the same for every seed and dataset size.
    """
    body, motion = trial.network.body("novice"), library.motion(trial, "validation")
    weights = loss_weights(body, Standardisation.fit(motion, maps_from=1))
    losses = validation_loss(model, motion, weights=weights)
    predicted, actual = roll_out(model, trial, library)
    position, heading = rollout_errors(predicted, actual, body)
    return Evaluation(losses, position.mean(0), heading.mean(0), predicted, actual)


def roll_out(model: Predictor, trial: Trial, library: Library) -> tuple[Tensor, Tensor]:
    """Predicted and actual states, each (B, ROLLOUT_STEPS + 1, S), of a trial's drives.

    The model gets the first state, the ground and the drive's own actions.
    """
    terrain, body = find_system(trial.system).terrain, trial.network.body("novice")
    heights = library.rollout_heights(trial)
    drives = seen_by(library.rollouts(trial), body)
    states = _stacked([drive.states[: ROLLOUT_STEPS + 1] for drive in drives])
    actions = _stacked([drive.actions[:ROLLOUT_STEPS] for drive in drives])
    predicted = rollout(
        model,
        heights,
        states[:, 0],
        actions,
        trial.network.pixels,
        spacing=terrain.spacing,
        body=body,
    )
    return predicted, states


def outcome_of(
    trial: Trial, trained: Trained, library: Library, pretraining_samples: int = 0
) -> Outcome:
    """Evaluate a trained model; the outcome is stored with the trial."""
    losses, position, heading, predicted, actual = evaluate(
        trained.model, trial, library
    )
    return Outcome(
        validation_loss=float(losses.sum()),
        component_losses=as_lists(losses),
        best_test_loss=float(trained.best_test_loss),
        position_error=as_lists(position),
        heading_error=as_lists(heading),
        **curve(trained),
        **every_test(trained),
        iterations=trained.iterations,
        samples=trained.samples,
        pretraining_samples=pretraining_samples,
        rollouts_predicted=as_lists(predicted[:ROLLOUTS_KEPT]),
        rollouts_actual=as_lists(actual[:ROLLOUTS_KEPT]),
    )


def curve(trained: Trained) -> dict[str, Any]:
    """The learning curve's summary as fields of a record.

    It has up to CURVE_POINTS evenly spaced tests, the first and the last among them.
    """
    count = len(trained.history)
    even = np.linspace(0, count - 1, min(count, CURVE_POINTS))
    tests = [trained.history[number] for number in np.unique(even.round().astype(int))]
    return {
        f"curve_{name}": tuple(getattr(test, name) for test in tests)
        for name in ("samples", "test_loss", "training_loss")
    }


def every_test(trained: Trained) -> dict[str, Any]:
    """All tests of a training as fields of a record.

    There are none where the training took a single test or measured no validation loss.
    The adversary's are left out where there was none.
    """
    history = trained.history
    if len(history) < 2 or any(test.validation_loss is None for test in history):
        return {}
    names = ["training_loss", "test_loss", "validation_loss"]
    names += [
        name
        for name in ("discriminator_accuracy", "matching_loss")
        if getattr(history[-1], name) is not None
    ]
    losses = {
        f"every_{name}": tuple(getattr(test, name) for test in history)
        for name in names
    }
    return {"test_spacing": history[0].samples} | losses


def as_lists(values: Tensor) -> Any:
    """A tensor as nested lists, which a record takes for its tuples."""
    return values.tolist()


def _stacked(arrays: list[np.ndarray]) -> Tensor:
    return torch.tensor(np.stack(arrays))
