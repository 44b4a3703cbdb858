"""Weights that other stopping rules would have kept of stored trainings.

This needs trainings that are stored with every test.
"""

from __future__ import annotations

import pandas as pd

from sidm.learning.stopping import (
    RELEASED_SMOOTHING,
    Curve,
    StoppingRule,
    kept_weights,
)

#: Rules by name. The paper stops once the test loss 'started increasing indicating
#: overfitting': first rise is the strictest reading, which noise can end. The loss
#: is smoothed as in the released code. A
#: rule that counts iterations of the released code counts 128 samples as one.
RULES: dict[str, StoppingRule] = {
    "first rise": StoppingRule(smoothing=RELEASED_SMOOTHING, patience=0),
    "patience": StoppingRule(patience=150_000),
    "released": StoppingRule(stopping="released"),
    "end": StoppingRule(),
}


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
    whole, kept = frame[frame.test_spacing > 0], []
    for _, row in whole.iterrows():
        # the smallest patience is one test
        patience = rule.patience if rule.patience != 0 else int(row.test_spacing)
        kept.append(kept_weights(stored_curve(row), rule._replace(patience=patience)))
    return whole.assign(
        kept_samples=[weights.samples for weights in kept],
        kept_test=[weights.test_loss for weights in kept],
        kept_validation=[weights.validation_loss for weights in kept],
        seen=[weights.seen for weights in kept],
        ended=[weights.ended for weights in kept],
    )
