"""What is stored of a trial: a row with its outcome, or how it failed."""

from __future__ import annotations

import dataclasses

from companion.engine.provenance import Provenance
from companion.trials import Trial
from sidm.config import config


@config
class Outcome:
    """What a trial yields, a function of the trial and its data alone.

    The loss is that of equation (1), in raw units of y unless the robot's body asks for
    other ones. K is the number of steps of a rollout, 0.1 s each. E tests of the
    training are stored, one after each `test_spacing` samples; trials of older versions
    have none.

    Attributes:
        validation_loss: loss of a sample of the validation set
        component_losses: (Y,) summands of the validation loss
        best_test_loss: smoothed loss on the novice's test split, of the weights kept
        position_error: (K,) m, mean over the rollouts, after each step
        heading_error: (K,) rad, mean over the rollouts, after each step
        curve_samples: (C,) samples seen at the C points of the learning curve's summary
        curve_test_loss: (C,) test loss at these points
        curve_training_loss: (C,) novice's training loss at these points
        iterations: prediction iterations in all
        samples: samples seen in prediction phases, those of a pretraining left out
        pretraining_samples: samples of the expert seen in the pretraining
        test_spacing: samples between two tests
        every_training_loss: (E,) loss on the novice's samples since the previous
            test
        every_test_loss: (E,) loss on the first trajectories of the novice's test split,
            not smoothed
        every_validation_loss: (E,) loss on the first trajectories of the validation set
        every_discriminator_accuracy: (E,) share of latents that the discriminator
            classified correctly in its last iteration; None before its first
        every_matching_loss: (E,) mean of equation (4) over the last matching; None
            before the first
        rollouts_predicted: (3, K + 1, 13) predicted states of the first rollouts
        rollouts_actual: (3, K + 1, 13) simulated states of the first rollouts
    """

    validation_loss: float
    component_losses: tuple[float, ...]
    best_test_loss: float
    position_error: tuple[float, ...]
    heading_error: tuple[float, ...]
    curve_samples: tuple[int, ...]
    curve_test_loss: tuple[float, ...]
    curve_training_loss: tuple[float, ...]
    iterations: int
    samples: int
    pretraining_samples: int = 0
    test_spacing: int = 0
    every_training_loss: tuple[float, ...] = ()
    every_test_loss: tuple[float, ...] = ()
    every_validation_loss: tuple[float, ...] = ()
    every_discriminator_accuracy: tuple[float | None, ...] = ()
    every_matching_loss: tuple[float | None, ...] = ()
    rollouts_predicted: tuple[tuple[tuple[float, ...], ...], ...] = ()
    rollouts_actual: tuple[tuple[tuple[float, ...], ...], ...] = ()


@config
class Row:
    """A stored trial with its outcome."""

    trial: Trial
    outcome: Outcome
    provenance: Provenance


@config
class Failure:
    """A stored trial whose training failed because a loss was not finite."""

    trial: Trial
    what: str  # the loss: 'training' or 'test'
    loss: str  # its value: 'nan' or 'inf'
    iteration: int  # prediction iterations until then
    provenance: Provenance

    def __str__(self) -> str:
        reason = f"the {self.what} loss was {self.loss}"
        return f"{self.trial}: failed, {reason} after {self.iteration} iterations"


#: Fields of an outcome that are long: they are stored beside the lines.
CURVES = tuple(
    field.name
    for field in dataclasses.fields(Outcome)
    if field.name.startswith(("curve_", "every_", "rollouts_"))
)
