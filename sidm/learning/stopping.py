"""The learning curve, and when training stops: when the smoothed test loss rises.

This is early stopping (section 4).
"""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Literal, NamedTuple

#: weight of the past in the smoothed test and training loss
RELEASED_SMOOTHING = 0.9
RELEASED_PATIENCE = 25_000  # prediction iterations
#: ratio of training loss to test loss below which the model counts as overfit
RELEASED_RATIO = 0.8
#: samples that count as an iteration: 2 trajectories of 64 steps
RELEASED_ITERATION = 128


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
    smoothing: float  # weight of the past in the smoothed loss, [0, 1)
    patience: int  # samples
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
        self.test_loss = _smooth(self.test_loss, test_loss, weight)
        self.training_loss = _smooth(self.training_loss, training_loss, weight)
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


class Curve(NamedTuple):
    """All E tests of a training that was run to its end."""

    samples: Sequence[int]  # (E,), seen in the prediction phases before each test
    training_loss: Sequence[float]  # (E,), as in `CurvePoint`
    test_loss: Sequence[float]  # (E,), not smoothed
    validation_loss: Sequence[float]  # (E,)
    iteration: int  # samples of one iteration


class StoppingRule(NamedTuple):
    """When a training ends; it keeps the weights of the lowest smoothed test loss."""

    stopping: Literal["test_loss", "released"] = "test_loss"  # as in `EarlyStopping`
    smoothing: float = 0.5  # weight of the past in the smoothed test loss
    patience: int | None = None  # samples without a new minimum; None: no limit
    max_samples: int | None = None  # None: no limit


class KeptWeights(NamedTuple):
    """The weights that a stopping rule keeps of a training."""

    samples: int  # seen when the weights were reached
    test_loss: float  # smoothed, which the rule compares
    validation_loss: float  # of these weights
    seen: int  # samples at the last test before the end
    ended: bool  # whether the rule ended the training; otherwise its curve ended first


def kept_weights(curve: Curve, rule: StoppingRule) -> KeptWeights:
    """The weights that a training would have kept if `rule` had stopped it."""
    limits = (rule.patience, rule.max_samples)
    patience, max_samples = (2**62 if limit is None else limit for limit in limits)
    stopper = EarlyStopping(rule.stopping, rule.smoothing, patience, max_samples)

    def ends(samples: int) -> bool:
        return stopper.finished(samples, samples // RELEASED_ITERATION)

    best, last, ended = None, 0, False
    tests = zip(curve.samples, curve.training_loss, curve.test_loss, strict=True)
    for number, (samples, training_loss, test_loss) in enumerate(tests):
        # a training that ends between two tests is not tested again
        ended = ends(samples - curve.iteration)
        if ended:
            break
        last, iteration = samples, samples // RELEASED_ITERATION
        if stopper.update(samples, iteration, training_loss, test_loss):
            best = number
    if best is None or stopper.best is None:
        raise ValueError("a training without a test keeps nothing")
    losses = stopper.best, curve.validation_loss[best]
    return KeptWeights(curve.samples[best], *losses, last, ended or ends(last))


def kept_after(
    curve: Curve, lengths: Sequence[int], smoothing: float = StoppingRule().smoothing
) -> list[KeptWeights]:
    """The weights that a training would have kept, had it ended after so many samples.

    This is `kept_weights` with each of the `lengths` as the `max_samples` of a rule
    without patience, in one pass.
    """
    smoothed = list(
        accumulate(curve.test_loss, lambda past, now: _smooth(past, now, smoothing))
    )
    best: list[int] = []  # test with the lowest smoothed loss so far
    for test, loss in enumerate(smoothed):
        lower = not best or loss < smoothed[best[-1]]
        best.append(test if lower else best[-1])
    # a training that ends between two tests is not tested again
    starts = [samples - curve.iteration for samples in curve.samples]
    kept = []
    for length in lengths:
        tests = bisect.bisect_left(starts, length)
        if tests == 0:
            raise ValueError("a training without a test keeps nothing")
        last, at = curve.samples[tests - 1], best[tests - 1]
        ended = tests < len(starts) or last >= length
        losses = smoothed[at], curve.validation_loss[at]
        kept.append(KeptWeights(curve.samples[at], *losses, last, ended))
    return kept


def _smooth(past: float | None, now: float, weight: float) -> float:
    """The smoothed loss after a loss of `now`, with the weight of the past."""
    return now if past is None else weight * past + (1 - weight) * now
