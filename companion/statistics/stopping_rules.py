"""Weights that a stopping rule would have kept of a training that ran to its end.

A rule is read from the stored tests of one training, not run. This needs trainings that
are stored with every test.
"""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from itertools import accumulate
from typing import Literal, NamedTuple

import pandas as pd

from sidm.learning.stopping import RELEASED_SMOOTHING, EarlyStopping, smoothed

#: samples that count as an iteration of the released code: 2 trajectories of 64 steps
RELEASED_ITERATION = 128


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
    #: samples without a new minimum; 0: those of one test; None: no limit
    patience: int | None = None
    max_samples: int | None = None  # None: no limit


#: Rules by name. The paper stops once the test loss 'started increasing indicating
#: overfitting': first rise is the strictest reading, with the smoothing of the released
#: code; noise can end it.
RULES: dict[str, StoppingRule] = {
    "first rise": StoppingRule(smoothing=RELEASED_SMOOTHING, patience=0),
    "patience": StoppingRule(patience=150_000),
    "released": StoppingRule(stopping="released"),
    "end": StoppingRule(),
}


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
    patience = patience or next(iter(curve.samples), 0)
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


def kept_after(curve: Curve, lengths: Sequence[int]) -> list[int]:
    """The test whose weights a training keeps that ends after so many samples.

    This is what `kept_weights` finds with each of the `lengths` as the `max_samples` of
    a rule without patience, in one pass.
    """
    smoothing = StoppingRule().smoothing
    losses = list(
        accumulate(curve.test_loss, lambda past, now: smoothed(past, now, smoothing))
    )
    best: list[int] = []  # test with the lowest smoothed loss so far
    for test, loss in enumerate(losses):
        lower = not best or loss < losses[best[-1]]
        best.append(test if lower else best[-1])
    # a training that ends between two tests is not tested again
    starts = [samples - curve.iteration for samples in curve.samples]
    done = [bisect.bisect_left(starts, length) for length in lengths]
    if 0 in done:
        raise ValueError("a training without a test keeps nothing")
    return [best[tests - 1] for tests in done]


def stored_curve(row: pd.Series) -> Curve:
    """The tests of a trial, a row of the results; empty for older trials."""
    spacing, count = int(row.test_spacing), len(row.every_test_loss)
    samples = [spacing * (number + 1) for number in range(count)]
    losses = row.every_training_loss, row.every_test_loss, row.every_validation_loss
    return Curve(samples, *losses, iteration=round(row.samples / row.iterations))


def apply_rule(frame: pd.DataFrame, rule: StoppingRule) -> pd.DataFrame:
    """Apply a stopping rule to the trials that are stored with every test.

    Their rows have further columns: `kept_samples`, `kept_test` and `kept_validation`
    of the kept weights; `seen`, the samples at the last test before the end; `ended`,
    whether the rule ended the training.
    """
    whole = frame[frame.test_spacing > 0]
    kept = [kept_weights(stored_curve(row), rule) for _, row in whole.iterrows()]
    return whole.assign(
        kept_samples=[weights.samples for weights in kept],
        kept_test=[weights.test_loss for weights in kept],
        kept_validation=[weights.validation_loss for weights in kept],
        seen=[weights.seen for weights in kept],
        ended=[weights.ended for weights in kept],
    )
