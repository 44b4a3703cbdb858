"""Figure 4's example in numbers."""

import dataclasses

import numpy as np
import pytest

from sidm.experiments import Study
from sidm.experiments.figures.paths import example


def test_an_example_is_held_against_all(make_row, tmp_path):
    trials = Study("laptop", tmp_path).points("system1", ["sidm"], (5.0,))
    actual = tuple((0.1 * step, 0.0) for step in range(26))
    rows = []
    for trial in trials:
        row = make_row(trial, 1.0)
        predicted = (*actual[:-1], (2.5, 0.5 * (1 + trial.seed)))
        outcome = dataclasses.replace(row.outcome, example_actual=actual, example_predicted=predicted)
        rows.append(dataclasses.replace(row, outcome=outcome))
    mean = np.mean([row.outcome.position_error[-1] for row in rows])
    assert example(rows, seed=1) == pytest.approx((2.5, 1.0, 1.0, mean))
    assert example(rows, seed=9) is None
