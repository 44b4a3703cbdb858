"""Half the data, on losses whose ratio is known."""

import pytest

from sidm.experiments import Study
from sidm.experiments.statistics.tables import final_position_error
from sidm.experiments.studies import variants
from sidm.experiments.studies.half_data import AGAINST, EQUAL, by_method, halved_words, halves

POWER = {"sidm": 1.0, "pretrain_finetune": 4.0, "mirrored": 16.0, "averaged": 6.0, "tethered": 16.0}  # of the data
SIZES = (1, 2, 5, 10)


@pytest.fixture
def rows(make_row, tmp_path):
    """Losses fall with the square root of the data; the tethered have two seeds, and no one SIDM at 10 min."""

    def loss(trial):
        return (1 + 0.01 * trial.seed) * (POWER[trial.method] * trial.novice_minutes) ** -0.5

    every = variants.trials(Study("laptop", tmp_path, tmp_path), "system1")
    trials = [trial for trial in every if trial.method in POWER]
    few = [trial for trial in trials if trial.method != "tethered" or trial.seed < 2]
    return [make_row(t, loss(t)) for t in few if (t.method, t.novice_minutes) != ("sidm", 10)]


def test_losses_are_held_against_those_with_twice_the_data_or_the_next_more(rows):
    found = halves(rows, "system1", "mirrored")
    assert [(one.minutes, one.against) for one in found] == [(size, other) for size in SIZES for other in AGAINST]
    beside = {one.minutes: one.beside for one in found if one.against == "sidm"}
    assert beside == {1: 2, 2: 5, 5: 20, 10: 20}
    assert {one.minutes: one.beside for one in found if one.against != "sidm"} == {1: 2, 2: 5, 5: 10, 10: 20}
    first = next(one for one in found if one.against == "pretrain_finetune")
    assert first.ratio.value == pytest.approx((4 * 2 / 16) ** 0.5) and first.sure


def test_at_equal_sizes_and_in_other_values(rows):
    """The made-up rows' position error is 0.26 m a unit of loss."""
    found = halves(rows, "system1", "mirrored", ["sidm"], EQUAL, final_position_error)
    assert [(one.minutes, one.beside) for one in found] == [(1, 1), (2, 2), (5, 5), (10, 20)]
    assert found[0].ratio.value == pytest.approx(1 / 4)


def test_a_method_that_saves_less_is_not_sure(rows):
    """Six times the data in effect against four."""
    found = {(one.minutes, one.against): one for one in halves(rows, "system1", "averaged")}
    assert not found[1, "pretrain_finetune"].sure and found[1, "sidm"].sure


def test_the_verdict_needs_every_point(rows):
    names = ("mirrored", "averaged", "tethered", "adapters")
    found = [line for name in names for line in halves(rows, "system1", name)]
    said = [("mirrored", "4 of 4", "4 of 4", "yes"), ("averaged", "4 of 4", "0 of 4", "no")]
    assert by_method(found, names, 4) == said
    assert by_method(found, names, 8)[0] == ("mirrored", "4 of 4", "4 of 4", "not all run")


def test_in_words(rows):
    words = halved_words(rows, "system1", "mirrored", halves(rows, "system1", "mirrored"))
    assert words.startswith("system1: with 1 min a loss of 0.253, for which 'expert first, then novice' needs 4")
    sides = "that of 'with SIDM' at 4 of 4 sizes and that of 'expert first, then novice' at 4 of 4 sizes"
    assert words.endswith(f"interval, than {sides}")
    assert halved_words(rows, "system1", "adapters", []) == "system1: not run"
    few = halved_words(rows, "system1", "tethered", halves(rows, "system1", "tethered"))
    assert few == "system1: too few seeds"


def test_of_another_system_nothing_is_known(rows):
    assert halves(rows, "system2", "mirrored") == [] == halves([], "system1", "mirrored")
