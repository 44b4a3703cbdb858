"""Ratios at each size, on curves whose ratio is known."""

import numpy as np
import pandas as pd
import pytest

from companion import Study
from companion.engine.frame import frame_of
from companion.statistics.pairs import complete
from companion.statistics.savings import (
    efficiency_band,
    ratio_texts,
    savings,
    savings_table,
)
from companion.studies import variants
from ownrobot.comparison.statistics import Interval

#: number of times that a method's data count
RATIO = {"sidm": 4.0, "novice_only": 1.0, "pretrain_finetune": 8.0}
NOISE = {("sidm", 1): 1.05, ("novice_only", 2): 1.05}  # factors of seeds, not paired


@pytest.fixture
def trials(tmp_path):
    return Study("laptop", tmp_path, tmp_path).figure3("system1")


@pytest.fixture
def frame(make_row, trials):
    def loss(trial):
        return (
            NOISE.get((trial.method, trial.seed), 1)
            * (RATIO[trial.method] * trial.novice_minutes) ** -0.5
        )

    return frame_of(make_row(trial, loss(trial)) for trial in trials)


def test_a_known_ratio_comes_out_at_each_size(frame):
    rows = savings(frame)
    assert rows.novice_minutes.tolist() == [1, 2, 5, 20, 60, 120]
    assert set(rows.seeds) == {3}
    assert rows.loss.tolist() == pytest.approx(
        (1 + 0.05 / 3) * (4 * rows.novice_minutes) ** -0.5
    )
    # 240 min would be needed, more than there are
    assert rows.bound.tolist() == ["=", "=", "=", "=", ">=", ">="]
    assert rows.ratio.tolist() == pytest.approx([4, 4, 4, 4, 2, 1], rel=0.05)
    assert rows.low[:4].between(2.5, 3.9).all()
    assert rows.high[:4].between(4.1, 6.5).all()
    assert not np.isfinite(rows.low[4])  # a bound has no interval
    assert savings(frame, ["pretrain_finetune"], ["sidm"]).ratio[0] == pytest.approx(
        2, rel=0.1
    )
    assert not len(savings(frame[:0])) and set(rows.system) == {"system1"}


def test_the_comparison_may_have_other_sizes(frame):
    """A method of small sizes is compared with the whole curve of another."""
    small = frame[(frame.method != "sidm") | (frame.novice_minutes < 10)]
    rows, whole = savings(small), savings(frame)
    assert rows.novice_minutes.tolist() == [1, 2, 5]
    assert rows.ratio.tolist() == pytest.approx(whole.ratio[:3].tolist())
    few = small[(small.method != "novice_only") | (small.seed != 2)]
    # the ratio is of seeds 0 and 1
    assert savings(few).ratio[0] == pytest.approx(4 * 1.025**-2, rel=0.01)


def test_a_level_curve_saves_nothing_at_its_right_end(make_row, trials):
    """A level end of a curve counts as its larger size.

    20 minutes that do no better than 5 are compared with the other method's need, not
    with 5 minutes.
    """
    sidm = dict(
        zip((1, 2, 5, 20, 60, 120), (0.5, 0.4, 0.3, 0.3, 0.2, 0.19), strict=True)
    )
    novice = dict(
        zip((1, 2, 5, 20, 60, 120), (0.6, 0.5, 0.4, 0.3, 0.25, 0.2), strict=True)
    )
    losses = {"sidm": sidm, "novice_only": novice, "pretrain_finetune": sidm}
    rows = savings(
        frame_of(make_row(t, losses[t.method][t.novice_minutes]) for t in trials)
    )
    assert rows.ratio[2] == pytest.approx(4) and rows.ratio[3] == pytest.approx(1)


def test_ratios_are_written_with_their_bounds(frame):
    rows = savings(frame)[:1]
    exact = rows.assign(ratio=4.0, low=3.0, high=5.04)
    bound = rows.assign(ratio=4.0, low=np.nan, bound=">=")
    assert ratio_texts(exact) == ["4.0 (3.0 to 5.0)"] and ratio_texts(bound) == [
        "at least 4.0"
    ]
    assert str(Interval(53.2, 0.0951, 372.0)) == "53 (0.095 to 370)"


def test_the_band_holds_the_curve(frame):
    losses = complete(frame, "system1")
    low, high = efficiency_band(
        losses.minutes, losses.values, np.array([0.3, 0.2, 0.05])
    )
    assert np.all(low[:2] < 4) and np.all(high[:2] > 4) and np.isnan(low[2])


def test_rivals_stand_side_by_side(frame, make_row, tmp_path):
    """A method whose data count 16 times needs a quarter of SIDM's data.

    It needs half of the pretrained one's.
    """
    study = Study("laptop", tmp_path, tmp_path)
    mine = [
        t
        for t in variants.trials(study, "system1")
        if t.method in ("mirrored", "tethered")
    ]
    power = {"mirrored": 16.0, "tethered": 8.0}
    own = frame_of(
        make_row(t, (power[t.method] * t.novice_minutes) ** -0.5) for t in mine
    )
    both = pd.concat([frame[frame.method != "novice_only"], own])
    rows = savings_table(
        both, ["mirrored", "tethered", "adapters"], ["sidm", "pretrain_finetune"]
    )
    points = [
        (method, minutes)
        for method in ("mirrored", "tethered")
        for minutes in (1, 2, 5, 10)
    ]
    assert list(zip(rows.method, rows.novice_minutes, strict=True)) == points
    assert rows.pretrain_finetune[:4].str.startswith("2.0 (").all()
    assert rows.sidm[0].startswith("4.")
    # the trial that was not run
    assert not len(savings_table(both, ["mirrored"], ["sidm", "novice_only"]))
    # the seeds that both sides have differ by comparison
    fewer = both[(both.method != "sidm") | (both.seed < 2)]
    assert len(savings_table(fewer, ["mirrored"], ["sidm", "pretrain_finetune"])) == 4
