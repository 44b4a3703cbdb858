"""Ratios at each size and component, on curves whose ratio is known."""

import numpy as np
import pytest

from sidm.experiments import Study
from sidm.experiments.savings import Saving, component_savings, efficiency_band, ratio_words, savings
from sidm.experiments.statistics import Interval
from sidm.experiments.tables import COMPONENTS, gather

RATIO = {"sidm": 4.0, "novice_only": 1.0, "pretrain_finetune": 8.0}  # of each method's data, in effect


@pytest.fixture
def rows(make_row, tmp_path):
    trials = Study("laptop", tmp_path, tmp_path).figure3("system1")
    return [make_row(t, (1 + 0.01 * t.seed) * (RATIO[t.method] * t.novice_minutes) ** -0.5) for t in trials]


def test_a_known_ratio_comes_out_at_each_size(rows):
    found = savings(rows, "system1")
    assert [one.minutes for one in found] == [1, 2, 5, 20, 60, 120]
    for one in found[:5]:  # 4 times 60 minutes are more than there are
        assert one.loss == pytest.approx(1.01 * (4 * one.minutes) ** -0.5)
    assert [one.bound for one in found] == ["=", "=", "=", "=", ">=", ">="]
    assert [one.ratio.value for one in found] == pytest.approx([4, 4, 4, 4, 2, 1], rel=0.05)
    assert found[1].ratio.low <= found[1].ratio.value <= found[1].ratio.high
    other = savings(rows, "system1", "pretrain_finetune", "sidm")
    assert other[0].ratio.value == pytest.approx(2, rel=0.05)
    assert savings([], "system1") == savings(rows, "system2") == []


def test_each_component_has_its_own(rows):
    """The made-up rows share their loss out evenly."""
    found = component_savings(rows, "system1")
    assert [name for name, _ in found] == [name for name, _ in COMPONENTS]
    assert all(one[0].ratio.value == pytest.approx(4, rel=0.05) for _, one in found)


def test_words_for_a_table():
    assert ratio_words(Saving(1.0, 0.5, Interval(4.0, 3.0, 5.04), "=")) == "4 [3, 5]"
    assert ratio_words(Saving(1.0, 0.5, Interval(4.0, np.nan, np.nan), ">=")) == "at least 4"
    assert ratio_words(Saving(1.0, 0.5, Interval(np.nan, np.nan, np.nan), "?")) == "cannot be told"


def test_the_band_holds_the_curve(rows):
    losses = gather(rows, "system1")
    low, high = efficiency_band(losses.minutes, losses.values, np.array([0.3, 0.2]))
    assert np.all(low <= 4.1) and np.all(high >= 3.9)
