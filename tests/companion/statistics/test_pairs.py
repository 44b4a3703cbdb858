"""Two sides of results, seed by seed, and tables of stored trials."""

import numpy as np
import pandas as pd
import pytest

from companion import Study
from companion.engine.frame import frame_of
from companion.statistics.pairs import (
    complete,
    page_table,
    paired_comparison,
    pooled_comparison,
    unique_results,
)
from companion.statistics.tables import wide
from sidm.config import replace


@pytest.fixture
def frame(tiny, make_row):
    """Results in which SIDM halves the loss, but for one seed where it is worse."""
    study = Study(tiny)
    losses = {
        "novice_only": [1.0, 2.0, 3.0],
        "sidm": [0.5, 1.0, 1.5],
        "mmd": [0.9, 2.1, 3.0],
    }
    trials = study.points("system1", list(losses), [0.25, 0.75], seeds=3)
    return frame_of(
        make_row(trial, losses[trial.method][trial.seed]) for trial in trials
    )


@pytest.fixture
def sides(frame):
    """The rows with SIDM, and those without."""
    return frame[frame.method == "sidm"], frame[frame.method == "novice_only"]


def test_ratios_are_of_means_paired_by_seed(frame, sides):
    rows = paired_comparison(frame[frame.method != "novice_only"], sides[1])
    assert list(rows.method) == ["sidm", "mmd"] * 2
    assert list(rows.novice_minutes) == [0.25, 0.25, 0.75, 0.75]
    line = rows.iloc[0]
    assert (line.seeds, line.reference, line["mean"], line.lower) == (3, 2.0, 1.0, 3)
    assert (line.ratio, line.low, line.high) == pytest.approx((0.5, 0.5, 0.5))
    assert rows.iloc[1].lower == 1 and rows.iloc[1].low < 1 < rows.iloc[1].high
    assert page_table(rows).iloc[0, -1] == "0.500 (0.500 to 0.500)"


def test_seeds_that_one_side_lacks_are_left_out(sides):
    own, reference = sides[0], sides[1][sides[1].seed == 1]
    rows = paired_comparison(own, reference)
    assert set(rows.seeds) == {1} and set(rows.reference) == {2.0}
    assert np.isnan(rows.low).all()
    assert len(paired_comparison(own, reference[:0])) == 0


def test_two_results_for_one_point_are_refused(frame, sides):
    with pytest.raises(ValueError, match="two rows of the same system"):
        paired_comparison(sides[0], frame)
    with pytest.raises(ValueError, match="method and seed; take the rows of one grid"):
        paired_comparison(frame.loc[[*frame.index, frame.index[0]]], sides[1])


def test_sizes_are_taken_together_by_the_geometric_mean(sides):
    """Half at one size and twice at another give 1."""
    sidm, alone = sides
    sidm = sidm.assign(
        validation_loss=sidm.validation_loss * np.where(sidm.novice_minutes > 0.5, 4, 1)
    )
    row = pooled_comparison(sidm, alone).iloc[0]
    assert row.ratio == pytest.approx(1)
    assert (row.seeds, row.sizes) == (3, (0.25, 0.75))
    less = sidm[(sidm.seed != 2) | (sidm.novice_minutes < 0.5)]
    assert pooled_comparison(less, alone).seeds[0] == 2
    assert not len(pooled_comparison(sidm[:0], sidm))


def test_what_is_complete_is_kept(figure3_frame, figure3_rows, make_row):
    """Seeds that lack a size are left out."""
    sidm = unique_results(figure3_frame, "system1", ["sidm"])
    rows = complete(sidm)
    assert rows.values.shape == (3, 6)
    assert rows.values[0] == pytest.approx((4 * rows.minutes) ** -0.5)
    part = complete(sidm[(sidm.seed != 2) | (sidm.novice_minutes != 5)])
    assert part.minutes.tolist() == [1, 2, 5, 20, 60, 120]
    assert part.values.shape == (2, 6) and part.seeds.tolist() == [0, 1]
    assert complete(figure3_frame[:0]).values.size == 0
    first = figure3_rows[0].trial
    other = make_row(first.replace(training=replace(first.training, p_expert=0.1)))
    with pytest.raises(ValueError, match="two results of system1 at one point"):
        unique_results(frame_of([*figure3_rows, other]), "system1", ["sidm"])


def test_a_wide_table_keeps_its_order_and_has_a_dash_where_nothing_is():
    rows = [(5, "sidm", "0.3"), (5, "alone", "0.4"), (1, "sidm", "0.5")]
    long = pd.DataFrame(rows, columns=["size", "method", "loss"])
    table = wide(long, ["size"], "method", "loss")
    assert table.columns.tolist() == ["size", "sidm", "alone"]
    assert table.to_numpy().tolist() == [[5, "0.3", "0.4"], [1, "0.5", "-"]]
