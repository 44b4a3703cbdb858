"""The cost of figures, from made-up rows."""

import pytest

from companion import Results, Study, load_preset
from companion.grids import figure_costs, figures_of, grid
from sidm.systems import FREE_SYSTEMS, SYSTEMS


def test_a_figure_costs_what_its_stored_trials_took(tmp_path, make_row):
    """Every figure has a line; a trial counts in each figure that uses it."""
    store, study = Results(tmp_path), Study("smoke", tmp_path, tmp_path)
    rows = [
        make_row(trial, 1.0)
        for trial in study.points("system1", ["sidm", "novice_only"], [0.5])
    ]
    for row in rows:
        store.put(row)
    lines = {
        one.figure: one for one in figure_costs(study, store).itertuples(index=False)
    }
    assert list(lines) == list(figures_of(study.preset))
    assert (lines["3"].trials, lines["3"].stored, lines["4"].stored) == (12, 2, 2)
    assert lines["3"].hours * 3600 == pytest.approx(
        sum(row.provenance.seconds for row in rows)
    )
    assert lines["3"].peak_memory == max(row.provenance.peak_memory for row in rows)
    assert lines["3"].devices == (rows[0].provenance.device,)
    assert lines["tuning"][2:] == (0, 0, 0, (), 0) and lines["3"].resumed == 0


def test_robots_with_free_struts_are_in_no_other_preset(tmp_path):
    """These robots have the p_e of the braked robots, and motion of their own."""
    free = grid("study", "free-struts", data=tmp_path, results=tmp_path)
    assert {trial.system for trial in free} == set(FREE_SYSTEMS)
    own = {trial.datasets["expert"].collection for trial in free}
    for name in ("smoke", "laptop"):
        every = grid(name, "all", data=tmp_path, results=tmp_path)
        assert {trial.system for trial in every} == set(SYSTEMS)
        assert own.isdisjoint(trial.datasets["expert"].collection for trial in every)
    preset = load_preset("study", p_expert_system2=0.125)
    shares = {
        trial.system: trial.training.p_expert
        for trial in grid(preset, "free-struts", data=tmp_path, results=tmp_path)
        if trial.method == "sidm"
    }
    assert shares["system2_free_struts"] == 0.125 != shares["system1_free_struts"]
