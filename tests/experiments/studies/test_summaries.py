"""Sentences follow from the numbers."""

import dataclasses

import numpy as np

from sidm.experiments import Study
from sidm.experiments.statistics.claims import NOT_SEEN, figure3_claims
from sidm.experiments.statistics.intervals import Interval
from sidm.experiments.studies import ablations
from sidm.experiments.studies.baselines import neighbours
from sidm.experiments.studies.choices import Worth
from sidm.experiments.studies.summaries import (
    NOTHING,
    ablation_summary,
    choices_summary,
    example_summary,
    figure3_summary,
    neighbours_summary,
    together_summary,
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


def test_an_ablation_names_its_ends_and_the_usual(make_row, tmp_path):
    trials = ablations.p_expert(Study("laptop", tmp_path), "system1", [0.25, 0.75, 0.9])
    rows = [make_row(trial, 1 + abs(trial.training.p_expert - 0.9)) for trial in trials]
    said = ablation_summary(rows, "p_expert", {"system1": 0.75})
    words = "lowest at 0.9 (1.000), highest at 0.25 (1.650), at Figure 3's 0.75 (1.150)"
    assert said == f"- system1, 5 min: {words}\n"
    one = ablation_summary([row for row in rows if row.trial.training.p_expert == 0.9], "p_expert", {"system1": 0.75})
    assert one == "- system1, 5 min: 0.9 alone is stored\n"
    assert "Figure 3" not in ablation_summary(rows, "p_expert", {"system1": 0.5})
    assert ablation_summary([], "p_expert", {}) == NOTHING


def test_what_a_value_leaves_of_the_method_is_on_its_line(make_row, tmp_path):
    """Without an expert, or without matching, a trial is of another method."""
    trials = ablations.p_expert(Study("laptop", tmp_path), "system1", [0.0, 0.75])
    assert {trial.method for trial in trials} == {"novice_only", "sidm"}
    stored = [trial for trial in trials if trial.training.p_expert != 0 or trial.seed == 0]
    rows = [make_row(trial, 1 + trial.training.p_expert) for trial in stored]
    assert ablation_summary(rows, "p_expert", {"system1": 0.75}) == (
        "- system1, 5 min: lowest at 0 (1.000, one trial), highest at 0.75 (1.750), at Figure 3's 0.75 (1.750)\n"
    )
    assert ablation_summary(rows, "p_expert", {"system1": 0.75}, by_method=True).count("alone is stored") == 2


def test_neighbours_are_sorted_by_their_intervals(make_row, tmp_path):
    losses = {"sidm": 1.0, "novice_only": 2.0, "pretrain_finetune": 0.5, "mmd": 1.0}
    trials = Study("laptop", tmp_path).points("system1", list(losses), (5.0,))
    noise = {"mmd": (0.1, -0.1, 0.05)}
    rows = [make_row(t, losses[t.method] + noise.get(t.method, (0, 0.01, 0.02))[t.seed]) for t in trials]
    said = neighbours_summary(neighbours(rows))
    assert said.startswith("- system1, 5 min: better than with SIDM: *expert first, then novice* (0.510); worse: ")
    assert said.count("\n") == 1 and "no difference seen: *" in said
    assert neighbours_summary(neighbours(row for row in rows if row.trial.seed == 0)) == NOTHING


def test_choices_are_sorted_by_their_intervals():
    one = Worth("system1", "a choice", "sidm", 5.0, 3, 1.0, 0.9, Interval(0.9, 0.8, 0.95))
    other = one._replace(choice="another", ratio=Interval(1.1, 1.05, 1.2))
    unclear, few = one._replace(ratio=Interval(1, 0.9, 1.1)), one._replace(seeds=2)
    assert choices_summary([one, other, unclear, few]) == (
        "Changed, the loss is smaller for *a choice* (system1, with SIDM). "
        "Changed, the loss is larger for *another* (system1, with SIDM). 1 of 3 comparisons show no difference."
    )
    assert choices_summary([few]) == "No comparison has 3 seeds yet."


def test_choices_together_are_sorted_by_size():
    one = Worth("system1", "all", "sidm", 1.0, 3, 1.0, 0.9, Interval(0.9, 0.8, 0.95))
    found = [one, one._replace(minutes=2.0), one._replace(minutes=5.0, ratio=Interval(1, 0.9, 1.1))]
    found += [one._replace(minutes=9.0, ratio=Interval(1.1, 1.05, 1.2)), one._replace(method="novice_only", seeds=2)]
    assert together_summary(found) == (
        "- *all*, system1, with SIDM: a smaller loss at 1, 2 min; no difference seen at 5 min; a larger loss at 9 min\n"
        "- *all*, system1, without SIDM: fewer than 3 seeds at 1 min\n"
    )
    assert together_summary([]) == NOTHING


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
