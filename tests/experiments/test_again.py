"""Trials on data made again elsewhere beside those of the results."""

import pytest

from sidm.experiments import Results, Study
from sidm.experiments.again import compared, store_of


def test_the_same_trials_are_found_by_all_but_their_data(tmp_path, make_row):
    """Two per cent less, seed by seed; what one side lacks is left out."""
    study, store = Study("laptop", tmp_path, tmp_path), Results(tmp_path)
    for trial in study.points("system1", ["novice_only", "sidm"], [5.0, 20.0]):
        store.put(make_row(trial, 1.0 + trial.seed))
        if trial.novice_minutes == 5 and trial.method == "sidm":
            again = trial.replace(novice_data="0123", expert_data="4567")
            store_of(tmp_path).put(make_row(again, 0.98 * (1 + trial.seed)))
    (line,) = compared(store, store_of(tmp_path))
    assert (line.system, line.method, line.minutes, line.seeds) == ("system1", "sidm", 5, 3)
    assert line.ratio == pytest.approx((0.98, 0.98, 0.98)) and line.stored == pytest.approx(2)
