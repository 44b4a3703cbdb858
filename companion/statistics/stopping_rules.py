"""What other stopping rules would have kept of trainings that are stored with every test."""

from __future__ import annotations

import pandas as pd

from sidm.learning.stopping import RELEASED_SMOOTHING, Curve, Kept, Rule, keep

#: Rules by name. The paper says that the test loss 'starts increasing': here, smoothed
#: as the released code does it, at the first of its tests. A rule that counts
#: iterations of the released code counts 128 samples as one.
RULES: dict[str, Rule] = {
    "the paper's": Rule(smoothing=RELEASED_SMOOTHING, patience=0),
    "this book's": Rule(patience=150_000),
    "the released code's": Rule(stopping="released"),
    "the end": Rule(),
}


def curve_of(row: pd.Series) -> Curve:
    """Every test of a trial, a line of `frame.frame_of`; of an older trial there are none."""
    spacing, count = int(row.test_spacing), len(row.every_test_loss)
    samples = [spacing * (number + 1) for number in range(count)]
    losses = row.every_training_loss, row.every_test_loss, row.every_validation_loss
    return Curve(samples, *losses, iteration=round(row.samples / row.iterations))


def kept(row: pd.Series, rule: Rule) -> Kept:
    """What a rule keeps of a trial; as small a patience as a single test means one."""
    if rule.patience == 0:
        rule = rule._replace(patience=int(row.test_spacing))
    return keep(curve_of(row), rule)


def kept_by(frame: pd.DataFrame, rule: Rule) -> pd.DataFrame:
    """The trials that are stored with every test, with what a rule keeps of each.

    `kept_samples`, `kept_test` and `kept_validation` are of the weights, `seen` the
    samples at the last test before the end, `ended` says whether the rule ended the
    training.
    """
    whole = frame[frame.test_spacing > 0]
    found = [kept(row, rule) for _, row in whole.iterrows()]
    return whole.assign(
        kept_samples=[one.samples for one in found],
        kept_test=[one.test_loss for one in found],
        kept_validation=[one.validation_loss for one in found],
        seen=[one.seen for one in found],
        ended=[one.ended for one in found],
    )
