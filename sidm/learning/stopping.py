"""The learning curve, and when training stops: when the smoothed test loss rises.

This is early stopping (section 4).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

#: weight of the past in the smoothed test and training loss
RELEASED_SMOOTHING = 0.9
RELEASED_PATIENCE = 25_000  # prediction iterations
#: ratio of training loss to test loss below which the model counts as overfit
RELEASED_RATIO = 0.8


class TrainingError(RuntimeError):
    """A training that failed because a loss is not finite; the message is one line."""

    def __init__(self, kind: str, loss: float, iteration: int):
        super().__init__(kind, loss, iteration)
        self.kind, self.loss, self.iteration = kind, loss, iteration

    def __str__(self) -> str:
        return (
            f"the {self.kind} loss is {self.loss} after {self.iteration} iterations; "
            "lower learning_rate, or look at the data"
        )


class CurvePoint(NamedTuple):
    """A point of the learning curve: the results of one test."""

    samples: int  # control steps of the prediction phases so far
    #: mean of equation (1) over the novice's samples since the previous test; over the
    #: expert's if there were none of the novice
    training_loss: float
    test_loss: float  # equation (1) on the novice's test split, not smoothed
    #: share of latents that the discriminator classified correctly in its last
    #: iteration; None without a discriminator phase so far
    discriminator_accuracy: float | None
    #: equation (1) on the validation set, which does not influence training; None: not
    #: measured
    validation_loss: float | None = None
    #: mean of equation (4) over the iterations of the last matching; None without one
    matching_loss: float | None = None


@dataclass
class EarlyStopping:
    """Follows the test loss and says when training ends.

    With the rule 'test_loss' training ends when the smoothed test loss has had no new
    minimum for `patience` samples. With 'released' it ends when the test loss, smoothed
    by 0.9, has had no new minimum for 25,000 iterations and the smoothed training loss
    is below 0.8 of it. With both it ends at `max_samples`.
    """

    rule: Literal["test_loss", "released"]
    #: weight of the past in the smoothed loss, [0, 1); 0.9 with 'released'
    smoothing: float
    patience: int  # samples; not used by 'released'
    max_samples: int
    test_loss: float | None = None  # smoothed
    training_loss: float | None = None  # smoothed
    best: float | None = None  # lowest smoothed test loss
    best_samples: int = 0  # samples seen when it was reached
    best_iteration: int = 0  # iterations done when it was reached

    def update(
        self, samples: int, iteration: int, training_loss: float, test_loss: float
    ) -> bool:
        """Add the losses of a test, and say whether its smoothed loss is the lowest."""
        weight = RELEASED_SMOOTHING if self.rule == "released" else self.smoothing
        self.test_loss = smoothed(self.test_loss, test_loss, weight)
        self.training_loss = smoothed(self.training_loss, training_loss, weight)
        if self.best is not None and not self.test_loss < self.best:
            return False
        self.best = self.test_loss
        self.best_samples, self.best_iteration = samples, iteration
        return True

    def finished(self, samples: int, iteration: int) -> bool:
        """Whether training ends after so many samples and iterations."""
        if samples >= self.max_samples:
            return True
        if self.test_loss is None or self.training_loss is None:
            return False
        if self.rule == "released":
            waited = iteration - self.best_iteration >= RELEASED_PATIENCE
            return waited and self.training_loss < RELEASED_RATIO * self.test_loss
        return samples - self.best_samples >= self.patience


def smoothed(past: float | None, now: float, weight: float) -> float:
    """The smoothed loss after a loss of `now`, with the weight of the past."""
    return now if past is None else weight * past + (1 - weight) * now
