"""Two sides of results, seed by seed."""

import numpy as np
import pytest

from companion import Study
from companion.engine.frame import frame_of
from companion.statistics.pairs import (
    complete,
    page_table,
    paired_comparison,
    pooled_comparison,
)
from sidm.config import replace


@pytest.fixture
def frame(tiny, tmp_path, make_row):
    """Results in which SIDM halves the loss, but for one seed where it is worse."""
    study = Study(tiny, tmp_path, tmp_path)
    losses = {
        "novice_only": [1.0, 2.0, 3.0],
        "sidm": [0.5, 1.0, 1.5],
        "mmd": [0.9, 2.1, 3.0],
    }
    trials = study.points("system1", list(losses), [0.25, 0.75], seeds=3)
    return frame_of(
        make_row(trial, losses[trial.method][trial.seed]) for trial in trials
    )


def test_ratios_are_of_means_paired_by_seed(frame):
    rows = paired_comparison(
        frame[frame.method != "novice_only"], frame[frame.method == "novice_only"]
    )
    assert list(rows.method) == ["sidm", "mmd"] * 2
    assert list(rows.novice_minutes) == [0.25, 0.25, 0.75, 0.75]
    line = rows.iloc[0]
    assert (line.seeds, line.reference, line["mean"], line.lower) == (3, 2.0, 1.0, 3)
    assert (line.ratio, line.low, line.high) == pytest.approx((0.5, 0.5, 0.5))
    assert rows.iloc[1].lower == 1 and rows.iloc[1].low < 1 < rows.iloc[1].high


def test_seeds_that_one_side_lacks_are_left_out(frame):
    reference = frame[(frame.method == "novice_only") & (frame.seed == 1)]
    rows = paired_comparison(frame[frame.method == "sidm"], reference)
    assert set(rows.seeds) == {1}
    assert set(rows.reference) == {2.0}
    assert np.isnan(rows.low).all()
    assert len(paired_comparison(frame[frame.method == "sidm"], reference[:0])) == 0


def test_two_results_for_one_point_are_refused(frame):
    with pytest.raises(
        ValueError, match="two rows of the same system, novice_minutes and seed"
    ):
        paired_comparison(frame[frame.method == "sidm"], frame)
    with pytest.raises(ValueError, match="method and seed; take the rows of one grid"):
        twice = frame.loc[[*frame.index, frame.index[0]]]
        paired_comparison(twice, frame[frame.method == "novice_only"])


def test_a_table_for_a_page_has_intervals_as_text(frame):
    rows = paired_comparison(
        frame[frame.method == "sidm"], frame[frame.method == "novice_only"]
    )
    page = page_table(rows, reference="without", mean="with")
    assert list(page.columns) == [
        "system",
        "novice data (min)",
        "method",
        "seeds",
        "without",
        "with",
        "ratio (95 % interval)",
    ]
    assert page.iloc[0, -1] == "0.500 (0.500 to 0.500)"


def test_differences_are_of_pairs(frame):
    """Losses 1, 2, 3 less 0.5, 1, 1.5."""
    sides = frame[frame.method == "sidm"], frame[frame.method == "novice_only"]
    row = paired_comparison(*sides, difference=True).iloc[0]
    assert row.difference == pytest.approx(-1) and row.low < -1 < row.high
    assert "difference (95 % interval)" in page_table(
        paired_comparison(*sides, difference=True)
    )


def test_sizes_are_taken_together_by_the_geometric_mean(frame):
    """Half at one size and twice at another give 1.

    A seed that lacks a size is left out.
    """
    sidm = frame[frame.method == "sidm"]
    sidm = sidm.assign(
        validation_loss=sidm.validation_loss * np.where(sidm.novice_minutes > 0.5, 4, 1)
    )
    row = pooled_comparison(sidm, frame[frame.method == "novice_only"]).iloc[0]
    assert row.ratio == pytest.approx(1)
    assert row.seeds == 3
    assert row.sizes == (0.25, 0.75)
    less = sidm[(sidm.seed != 2) | (sidm.novice_minutes < 0.5)]
    assert pooled_comparison(less, frame[frame.method == "novice_only"]).seeds[0] == 2
    assert not len(pooled_comparison(sidm[:0], sidm))


def test_what_is_complete_is_kept(figure3_frame, figure3_rows, make_row):
    """Sizes that a method lacks are removed first, then seeds that lack any size."""
    rows = complete(figure3_frame, "system1")
    assert rows.minutes.tolist() == [1, 2, 5, 20, 60, 120]
    assert rows.values.shape == (3, 2, 6)
    assert rows.values[0, 0] == pytest.approx((4 * rows.minutes) ** -0.5)
    part = figure3_frame[
        (figure3_frame.method != "sidm") | (figure3_frame.novice_minutes != 60)
    ]
    part = part[(part.seed != 2) | (part.novice_minutes != 5)]
    assert complete(part, "system1").minutes.tolist() == [1, 2, 5, 20, 120]
    assert complete(part, "system1").values.shape == (2, 2, 5)
    assert complete(part, "system1").seeds.tolist() == [0, 1]
    assert complete(part[:0], "system1").values.size == 0
    first = figure3_rows[0].trial
    other = make_row(first.replace(training=replace(first.training, p_expert=0.1)))
    with pytest.raises(ValueError, match="two results of system1 at one point"):
        complete(frame_of([*figure3_rows, other]), "system1")
