"""What figures cost, from made-up rows."""

import pytest

from sidm.experiments import Results, Study
from sidm.experiments.grids import figure_costs, figures_of


def test_a_figure_costs_what_its_stored_trials_took(tmp_path, make_row):
    """Every figure has a line; a trial counts in each that it serves."""
    store, study = Results(tmp_path), Study("smoke", tmp_path, tmp_path)
    rows = [make_row(trial, 1.0) for trial in study.points("system1", ["sidm", "novice_only"], [0.5])]
    for row in rows:
        store.put(row)
    lines = {one.figure: one for one in figure_costs(study, store)}
    assert list(lines) == list(figures_of(study.preset))
    assert (lines["3"].trials, lines["3"].stored, lines["4"].stored) == (12, 2, 2)
    assert lines["3"].hours * 3600 == pytest.approx(sum(row.provenance.seconds for row in rows))
    assert lines["3"].peak_memory == max(row.provenance.peak_memory for row in rows)
    assert lines["3"].devices == (rows[0].provenance.device,)
    assert lines["tuning"][2:] == (0, 0, 0, (), 0) and lines["3"].resumed == 0
