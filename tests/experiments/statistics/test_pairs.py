"""Two sides of results, seed by seed."""

import numpy as np
import pytest

from sidm.experiments import Study
from sidm.experiments.engine.frame import frame_of
from sidm.experiments.statistics.pairs import beside, written


@pytest.fixture
def frame(tiny, tmp_path, make_row):
    """Half the loss with SIDM, but for a seed that it does badly with."""
    study = Study(tiny, tmp_path, tmp_path)
    losses = {"novice_only": [1.0, 2.0, 3.0], "sidm": [0.5, 1.0, 1.5], "mmd": [0.9, 2.1, 3.0]}
    trials = study.points("system1", list(losses), [0.25, 0.75], seeds=3)
    return frame_of(make_row(trial, losses[trial.method][trial.seed]) for trial in trials)


def test_ratios_are_of_means_paired_by_seed(frame):
    found = beside(frame[frame.method != "novice_only"], frame[frame.method == "novice_only"])
    assert list(found.method) == ["sidm", "mmd"] * 2 and list(found.novice_minutes) == [0.25, 0.25, 0.75, 0.75]
    line = found.iloc[0]
    assert (line.seeds, line.reference, line["mean"], line.lower) == (3, 2.0, 1.0, 3)
    assert (line.ratio, line.low, line.high) == pytest.approx((0.5, 0.5, 0.5))
    assert found.iloc[1].lower == 1 and found.iloc[1].low < 1 < found.iloc[1].high


def test_seeds_that_one_side_lacks_are_left_out(frame):
    reference = frame[(frame.method == "novice_only") & (frame.seed == 1)]
    found = beside(frame[frame.method == "sidm"], reference)
    assert set(found.seeds) == {1} and set(found.reference) == {2.0} and np.isnan(found.low).all()
    assert len(beside(frame[frame.method == "sidm"], reference[:0])) == 0


def test_two_results_for_one_point_are_refused(frame):
    with pytest.raises(ValueError, match="two rows of the same system, novice_minutes and seed"):
        beside(frame[frame.method == "sidm"], frame)
    with pytest.raises(ValueError, match="method and seed; take the rows of one grid"):
        twice = frame.loc[[*frame.index, frame.index[0]]]
        beside(twice, frame[frame.method == "novice_only"])


def test_a_table_for_a_page_has_intervals_as_text(frame):
    found = beside(frame[frame.method == "sidm"], frame[frame.method == "novice_only"])
    page = written(found, reference="without", mean="with")
    assert list(page.columns) == [
        "system", "novice data (min)", "method", "seeds", "without", "with", "ratio [95 % interval]"
    ]  # fmt: skip
    assert page.iloc[0, -1] == "0.5 [0.5, 0.5]"
