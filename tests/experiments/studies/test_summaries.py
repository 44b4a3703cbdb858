"""Sentences follow from the numbers."""

import dataclasses

import numpy as np

from sidm.experiments import Study
from sidm.experiments.statistics.claims import NOT_SEEN, figure3_claims
from sidm.experiments.studies.summaries import (
    example_summary,
    figure3_summary,
)


def test_figure_3_in_short(make_row, tmp_path):
    """Losses of 1 / minutes, of 2 / minutes without SIDM, and a tenth of the loss where the expert was first."""
    factors = {"sidm": 1.0, "novice_only": 2.0, "pretrain_finetune": 0.1}
    trials = Study("laptop", tmp_path).figure3("system1")
    rows = [make_row(t, factors[t.method] * (1 + 0.01 * t.seed) / t.novice_minutes) for t in trials]
    first, other = figure3_summary(figure3_claims(rows), rows, ("system1", "system2"))
    assert first.startswith("system1: with SIDM as good as without it on at best 2 x [2, 2] the data (the paper: up to")
    assert first.endswith("times the data, and as with SIDM on 10 [10, 10] times")
    assert other == "system2: not run" and "; the two curves are not comparable by 120 min; " in first
    late = [t for t in trials if t.novice_minutes >= 20]
    meet = [row for row in rows if row.trial not in late] + [make_row(t, 2.0 / t.novice_minutes) for t in late]
    (said,) = figure3_summary(figure3_claims(meet), meet, ["system1"])
    assert "; the two curves are comparable from 20 min; " in said
    two = [row for row in rows if row.trial.seed < 2]
    assert "; the two curves have too few seeds; " in figure3_summary(figure3_claims(two), two, ["system1"])[0]
    assert "room for none" not in first
    unsure = [claim._replace(verdict=NOT_SEEN) for claim in figure3_claims(rows)]
    assert "the data, which leaves room for none at all (the paper" in figure3_summary(unsure, rows, ["system1"])[0]


def test_an_example_is_held_against_all(make_row, tmp_path):
    trials = Study("laptop", tmp_path).points("system1", ["sidm"], (5.0,))
    actual = tuple((0.1 * step, 0.0) for step in range(26))
    rows = []
    for trial in trials:
        row = make_row(trial, 1.0)
        predicted = (*actual[:-1], (2.5, 0.5 * (1 + trial.seed)))
        outcome = dataclasses.replace(row.outcome, example_actual=actual, example_predicted=predicted)
        rows.append(dataclasses.replace(row, outcome=outcome))
    said = example_summary(rows, seed=1)
    assert "drives 2.5 m" in said and "end 1 to 1 m" in said
    assert f"{np.mean([row.outcome.position_error[-1] for row in rows]):.2g} m in the mean" in said
    assert said.endswith("mean.")
    far = [dataclasses.replace(row, outcome=dataclasses.replace(row.outcome, position_error=(9.0,))) for row in rows]
    assert example_summary(far, seed=1).endswith("9 m in the mean, so the example is an easy one.")
    assert example_summary(rows, seed=9) == "The trials of this seed are not stored."
