"""Verdicts by the rule of the page on claims, on results whose answers are known."""

import numpy as np
import pandas as pd
import pytest

from companion.engine.frame import frame_of
from companion.statistics.claims import (
    BETTER,
    CONTRARY,
    DIRECTION,
    NO_DIFFERENCE,
    NO_VERDICT,
    NOT_SEEN,
    REPRODUCED,
    UNCLEAR,
    WORSE,
    convergence_claim,
    figure3_claims,
    figure4_claims,
    page_table,
    ratio_verdicts,
    verdict,
)
from ownrobot.comparison.statistics import Interval


@pytest.mark.parametrize(
    ("ends", "paper", "says"),
    [
        ((18, 12, 25), (1, 20), REPRODUCED),
        ((5, 0.1, 99), (1, 20), NOT_SEEN),
        ((8, 4, 12), (1, 20), DIRECTION),
        ((0.5, 0.3, 0.8), (1, 20), CONTRARY),
        ((0.2, 0.1, 0.3), (0, None, False), CONTRARY),
        ((-0.2, -0.3, -0.1), (0, None, False), DIRECTION),
        ((np.nan, np.nan, np.nan), (1, 20), NO_VERDICT),
    ],
)
def test_verdicts_follow_the_rule_whatever_comes_out(ends, paper, says):
    assert verdict(Interval(*ends), *paper) == says


def test_ratios_are_better_or_worse_by_their_whole_interval():
    nan = float("nan")
    table = pd.DataFrame({"low": [0.7, 1.1, 0.9, nan], "high": [0.9, 1.2, 1.1, nan]})
    assert ratio_verdicts(table).tolist() == [BETTER, WORSE, NO_DIFFERENCE, NO_VERDICT]


def test_a_saving_of_four_is_in_the_papers_direction(figure3_frame):
    """Neither the paper's 20 × nor its 5 × is in the interval."""
    rows = figure3_claims(figure3_frame)
    assert rows.ours[0] == "4.00 (4.00 to 4.00) ×"
    assert rows.verdict.tolist() == [DIRECTION] * 2 + [UNCLEAR] * 2 + [DIRECTION] * 2
    # fine-tuning has the loss without SIDM here
    assert rows.value[4] == pytest.approx(5**-0.5 * (1 - 0.5) * 1.01)
    assert "nan" not in page_table(rows).to_string()
    deviations = figure4_claims(figure3_frame)
    assert deviations.verdict.tolist() == [DIRECTION] * 4
    assert (deviations.value < 0).all()


def test_nothing_run_or_one_seed_gives_no_verdict(figure3_frame):
    nothing = figure3_frame[:0]
    assert not len(figure3_claims(nothing)) and not len(figure4_claims(nothing))
    single = figure3_claims(figure3_frame[figure3_frame.seed == 0])
    assert single.ours[0] == "4.00 ×" and single.ours[2] == "-"
    assert set(single.verdict) == {NO_VERDICT, UNCLEAR} and set(single.seeds) == {1}


def test_curves_meet_from_the_size_on_at_which_they_stay_the_same(
    laptop, make_row, power_law
):
    def late(trial, worse):
        return 0.1 + worse * (trial.method == "sidm") * (trial.novice_minutes > 20)

    for worse, words in ((0, "alike from 20 min on"), (0.1, "worse from 60 min on")):
        rows = frame_of(
            make_row(t, power_law(t) if t.novice_minutes < 20 else late(t, worse))
            for t in laptop.figure3("system1")
        )
        assert convergence_claim(rows, "system1").ours[0] == f"with SIDM {words}"
        few = rows[(rows.novice_minutes < 60) | (rows.seed == 0)]  # no interval there
        assert (
            convergence_claim(few, "system1").ours[0]
            == "with SIDM alike from 20 min on"
        )
