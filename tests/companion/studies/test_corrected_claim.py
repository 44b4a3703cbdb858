"""The claim about the corrected model: its trials, and its rule on made-up results."""

import pytest

from companion import Study
from companion.engine.frame import frame_of
from companion.studies.corrected_claim import (
    FIRST_SEED,
    METHOD,
    PAIRS,
    RIVALS,
    SIZES,
    table,
    trials,
    verdict,
)


@pytest.fixture(scope="module")
def every(tmp_path_factory):
    study = Study(
        "study", tmp_path_factory.mktemp("nothing"), tmp_path_factory.mktemp("results")
    )
    return [trial for system in PAIRS for trial in trials(study, system)]


def losses(power):
    """Function for made-up losses in which data of a method count `power` times.

    The seed makes a little difference.
    """
    return lambda t: (
        (1 + 0.01 * (t.seed - FIRST_SEED))
        * (power.get(t.method, 1.0) * t.novice_minutes) ** -0.5
    )


def test_rivals_have_twice_the_data_and_nothing_was_chosen_by_any_of_it(every):
    assert {t.novice_minutes for t in every if t.method == METHOD} == set(SIZES)
    assert {t.novice_minutes for t in every if t.method in RIVALS} == {
        2 * minutes for minutes in SIZES
    }
    assert {t.motion for t in every} == {"claim"}
    assert {t.seed for t in every} == set(range(100, 105))
    seeds = {
        t.datasets[kind].collection.seed
        for t in every
        for kind in ("novice", "validation", "rollout")
    }
    assert seeds == {20, 21, 23}
    assert len(every) == 5 * len(PAIRS) * len(SIZES) * (1 + len(RIVALS))


def test_the_claim_holds_where_three_times_the_data_of_the_best_rival_are_worth_less(
    every, make_row
):
    """The best rival is as good as 1.4 times its data.

    Twice the data would be enough, and 2.8 times are needed.
    """
    best = {"pretrain_finetune": 1.4}
    rows = table(frame_of(make_row(t, losses({METHOD: 3.0} | best)(t)) for t in every))
    assert len(rows) == len(PAIRS) * len(SIZES)
    assert set(rows.rival) == {"pretrain_finetune"}
    assert rows.ratio.tolist() == pytest.approx([(2.8 / 3) ** 0.5] * len(rows))
    assert verdict(rows) is True
    less = table(frame_of(make_row(t, losses({METHOD: 2.7} | best)(t)) for t in every))
    assert verdict(less) is False and not less.holds.any()


def test_before_all_pairs_are_run_the_claim_can_only_fail(every, make_row):
    rows = frame_of(
        make_row(t, losses({METHOD: 9.0})(t)) for t in every if t.system != PAIRS[-1]
    )
    assert verdict(table(rows)) is None and verdict(table(rows[:0])) is None
    every_pair = frame_of(
        make_row(t, losses({METHOD: 9.0})(t)) for t in every if t.method != RIVALS[-1]
    )
    # the missing rival could have been the best
    assert not len(table(every_pair)) and verdict(table(every_pair)) is None
    less = frame_of(make_row(t, losses({})(t)) for t in every if t.system == PAIRS[0])
    assert verdict(table(less)) is False
