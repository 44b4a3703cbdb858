"""Rows as tables and lines for a page."""

import numpy as np
import pytest

from sidm.experiments import Results, Study
from sidm.experiments.engine.frame import frame_of
from sidm.experiments.statistics.tables import (
    COMPONENTS,
    component_lines,
    costs,
    html_list,
    markdown_table,
    provenance_block,
    provenance_html,
    provenance_line,
    spread,
    stored_line,
)
from sidm.learning.observation import TARGET_SIZE


@pytest.fixture
def trials(tiny):
    study = Study(tiny)
    return study.figure3("system1") + study.figure3("system2")


def test_what_is_missing_is_counted_by_system_with_the_command_that_runs_it(tmp_path, trials, make_row):
    store = Results(tmp_path)
    assert stored_line(store, trials, "run it") == (
        "9 of 9 trials are missing (6 of system1, 3 of system2); `run it` runs them."
    )
    for trial in trials[:6]:
        store.put(make_row(trial))
    assert "3 of 9 trials are missing (0 of system1, 3 of system2)" in stored_line(store, trials, "run it")
    for trial in trials[6:]:
        store.put(make_row(trial))
    assert stored_line(store, trials, "run it") == "All 9 trials are stored."


def test_a_provenance_block_is_the_line_in_the_books_class(trials, make_row):
    for rows in ([], [make_row(trials[0])]):
        lines = provenance_block(rows, "run it").splitlines()
        assert lines == ['<div class="provenance">', "", provenance_line(rows, "run it"), "", "</div>"]
    assert provenance_html([], "run <it>") == (
        '<div class="provenance"><p>No trials stored; <code>run &lt;it&gt;</code> runs them.</p></div>'
    )


def test_lines_become_a_list():
    assert html_list(["a < b", "'c'"]) == "<ul><li>a &lt; b</li><li>'c'</li></ul>"


def test_a_table_rounds_floats_and_keeps_all_else():
    assert markdown_table(["name", "loss"], [("a", 1.23456), ("b", 12)]) == (
        "| name | loss |\n| --- | --- |\n| a | 1.23 |\n| b | 12 |\n"
    )
    assert markdown_table(["name", "loss"], []) == "No trials stored."


def test_spread_is_over_the_rows_of_a_key(trials, make_row):
    pairs = zip(trials[3:], (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), strict=True)
    rows = [make_row(trial, loss) for trial, loss in pairs]
    found = spread(frame_of(rows), ["system"])
    assert found.values.tolist() == [["system1", 3, 2.0, 1.0, 3.0], ["system2", 3, 5.0, 4.0, 6.0]]
    assert list(found.columns) == ["system", "trials", "mean", "minimum", "maximum"]
    assert len(spread(frame_of([]), ["system"])) == 0


def test_costs_are_by_system_and_method(trials, make_row):
    rows = [make_row(trial) for trial in trials if trial.system == "system1"]  # of 12 s each
    found = costs(frame_of(rows))
    assert set(found.method) == {"sidm", "novice_only", "pretrain_finetune"} and found.trials.sum() == len(rows)
    assert set(found["mean (min)"]) == set(found["longest (min)"]) == {0.2}


def test_component_lines_are_roots_of_mean_squares():
    few, many = [[4.0] * TARGET_SIZE, [14.0] * TARGET_SIZE], [[1.0] * TARGET_SIZE]
    lines = component_lines([few, many])
    assert len(lines) == len(COMPONENTS) == TARGET_SIZE
    assert lines[3][:2] == ("quaternion x", "-") and lines[12][:2] == ("angular velocity z", "rad/s")
    np.testing.assert_allclose([line[2:] for line in lines], [[3.0, 1.0]] * TARGET_SIZE)
    assert component_lines([]) == []
