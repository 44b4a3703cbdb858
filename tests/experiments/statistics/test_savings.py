"""Ratios at each size and component, on curves whose ratio is known."""


import numpy as np
import pytest

from sidm.experiments import Study
from sidm.experiments.statistics.intervals import Interval
from sidm.experiments.statistics.savings import (
    Saving,
    efficiency_band,
    ratio_words,
    rivals,
    savings,
)
from sidm.experiments.statistics.tables import gather
from sidm.experiments.studies import variants

RATIO = {"sidm": 4.0, "novice_only": 1.0, "pretrain_finetune": 8.0}  # of each method's data, in effect
NOISE = {("sidm", 1): 1.05, ("novice_only", 2): 1.05}  # of single seeds, not paired


@pytest.fixture
def trials(tmp_path):
    return Study("laptop", tmp_path, tmp_path).figure3("system1")


@pytest.fixture
def rows(make_row, trials):
    def loss(trial):
        return NOISE.get((trial.method, trial.seed), 1) * (RATIO[trial.method] * trial.novice_minutes) ** -0.5

    return [make_row(trial, loss(trial)) for trial in trials]


def test_a_known_ratio_comes_out_at_each_size(rows):
    found = savings(rows, "system1")
    assert [one.minutes for one in found] == [1, 2, 5, 20, 60, 120]
    for one in found:
        assert one.loss == pytest.approx((1 + 0.05 / 3) * (4 * one.minutes) ** -0.5)
    assert [one.bound for one in found] == ["=", "=", "=", "=", ">=", ">="]  # there are no 240 min
    assert [one.ratio.value for one in found] == pytest.approx([4, 4, 4, 4, 2, 1], rel=0.05)
    for one in found[:4]:
        assert 2.5 < one.ratio.low < 3.9 and 4.1 < one.ratio.high < 6.5
    assert not np.isfinite(found[4].ratio.low)  # a bound has no interval
    other = savings(rows, "system1", "pretrain_finetune", "sidm")
    assert other[0].ratio.value == pytest.approx(2, rel=0.1)
    assert savings([], "system1") == savings(rows, "system2") == []


def test_the_comparison_may_have_other_sizes(rows, trials, make_row):
    """A method of small sizes is held against the whole curve of another."""
    small = [row for row in rows if row.trial.method != "sidm" or row.trial.novice_minutes < 10]
    found, whole = savings(small, "system1"), savings(rows, "system1")
    assert [one.minutes for one in found] == [1, 2, 5]
    assert [one.ratio.value for one in found] == pytest.approx([one.ratio.value for one in whole[:3]])
    few = [row for row in small if (row.trial.method, row.trial.seed) != ("novice_only", 2)]
    assert savings(few, "system1")[0].ratio.value == pytest.approx(4 * 1.025**-2, rel=0.01)  # of seeds 0 and 1


def test_a_level_curve_saves_nothing_at_its_right_end(make_row, trials):
    """20 minutes that do no better than 5 are compared with what the other needs for that, not with 5 minutes."""
    sidm = dict(zip((1, 2, 5, 20, 60, 120), (0.5, 0.4, 0.3, 0.3, 0.2, 0.19), strict=True))
    novice = dict(zip((1, 2, 5, 20, 60, 120), (0.6, 0.5, 0.4, 0.3, 0.25, 0.2), strict=True))
    losses = {"sidm": sidm, "novice_only": novice, "pretrain_finetune": sidm}
    found = savings([make_row(t, losses[t.method][t.novice_minutes]) for t in trials], "system1")
    assert found[2].ratio.value == pytest.approx(4) and found[3].ratio.value == pytest.approx(1)


def test_words_for_a_table():
    assert ratio_words(Saving(1.0, 0.5, Interval(4.0, 3.0, 5.04), "=")) == "4 [3, 5]"
    assert ratio_words(Saving(1.0, 0.5, Interval(4.0, np.nan, np.nan), ">=")) == "at least 4"
    assert str(Interval(53.2, 0.0951, 372.0)) == "53 [0.095, 370]"


def test_the_band_holds_the_curve(rows):
    losses = gather(rows, "system1")
    low, high = efficiency_band(losses.minutes, losses.values, np.array([0.3, 0.2, 0.05]))
    assert np.all(low[:2] < 4) and np.all(high[:2] > 4) and np.isnan(low[2])


def test_rivals_are_held_against_both(rows, make_row, tmp_path):
    """A method of 16 times the data in effect needs a quarter of SIDM's, half of the pretrained one's."""
    study = Study("laptop", tmp_path, tmp_path)
    mine = [t for t in variants.trials(study, "system1") if t.method in ("mirrored", "tethered")]
    power = {"mirrored": 16.0, "tethered": 8.0}
    beaten = [row for row in rows if row.trial.method != "novice_only"]
    found = rivals(
        [*beaten, *(make_row(t, (power[t.method] * t.novice_minutes) ** -0.5) for t in mine)], "system1",
        ["mirrored", "tethered", "adapters"],
    )  # fmt: skip
    assert [(one.method, one.saving["sidm"].minutes) for one in found] == [
        (method, minutes) for method in ("mirrored", "tethered") for minutes in (1, 2, 5, 10)
    ]
    for one in found[:4]:
        assert one.saving["pretrain_finetune"].ratio.value == pytest.approx(2, rel=0.01)
        assert one.saving["sidm"].ratio.value == pytest.approx(4, rel=0.05)


def test_a_comparison_that_was_not_run_saves_nothing(rows):
    alone = [row for row in rows if row.trial.method == "sidm"]
    assert savings(alone, "system1") == rivals(alone, "system1", ["sidm"], ["novice_only", "sidm"]) == []
    one = [row for row in rows if row.trial.seed == 0 or row.trial.method != "novice_only"]
    assert rivals(one, "system1", ["sidm"], ["novice_only", "pretrain_finetune"])
