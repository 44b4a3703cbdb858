"""Half the data, on losses whose ratio is known."""

import pytest

from companion import Study
from companion.engine.frame import frame_of
from companion.studies import variants
from companion.studies.variants import AGAINST, EQUAL, by_method, table

#: number of times that a method's data count
POWER = {
    "sidm": 1.0,
    "pretrain_finetune": 4.0,
    "mirrored": 16.0,
    "averaged": 6.0,
    "tethered": 16.0,
}
SIZES = (1, 2, 5, 10)


@pytest.fixture
def frame(make_row, tmp_path):
    """Losses that fall with the square root of the data.

    `tethered` has two seeds, and `sidm` lacks 10 min.
    """

    def loss(trial):
        return (1 + 0.01 * trial.seed) * (
            POWER[trial.method] * trial.novice_minutes
        ) ** -0.5

    every = variants.trials(Study("laptop", tmp_path, tmp_path), "system1")
    trials = [trial for trial in every if trial.method in POWER]
    few = [trial for trial in trials if trial.method != "tethered" or trial.seed < 2]
    return frame_of(
        make_row(t, loss(t))
        for t in few
        if (t.method, t.novice_minutes) != ("sidm", 10)
    )


def test_losses_are_held_against_those_with_twice_the_data_or_the_next_more(frame):
    rows = table(frame, ["mirrored"])
    assert list(zip(rows.novice_minutes, rows.against, strict=True)) == [
        (s, o) for s in SIZES for o in AGAINST
    ]
    with_sidm, first = (
        rows[rows.against == other].set_index("novice_minutes") for other in AGAINST
    )
    assert with_sidm.with_minutes.to_dict() == {1: 2, 2: 5, 5: 20, 10: 20}
    assert first.with_minutes.to_dict() == {1: 2, 2: 5, 5: 10, 10: 20}
    assert first.ratio[1] == pytest.approx((4 * 2 / 16) ** 0.5) and first.high[1] < 1


def test_at_equal_sizes_and_in_other_values(frame):
    other = frame.assign(error=2 * frame.validation_loss)
    rows = table(other, ["mirrored"], ["sidm"], EQUAL, "error")
    assert list(rows.with_minutes) == [1, 2, 5, 20]
    assert rows.ratio[0] == pytest.approx(1 / 4)
    assert rows["mean"][0] == pytest.approx(2 * 1.01 / 4)


def test_a_method_that_saves_less_is_not_sure(frame):
    """Data count six times against four times."""
    rows = table(frame, ["averaged"]).set_index(["novice_minutes", "against"])
    assert rows.high[1, "pretrain_finetune"] > 1 > rows.high[1, "sidm"]


def test_the_verdict_needs_every_point(frame):
    rows = table(frame, ["mirrored", "averaged", "tethered", "adapters"])
    expected = {
        "averaged": ["4 of 4", "0 of 4", "no"],
        "mirrored": ["4 of 4", "4 of 4", "yes"],
    }
    assert by_method(rows, 4).set_index("method").T.to_dict("list") == expected
    assert by_method(rows, 8).set_index("method").half["mirrored"] == "not all run"
    assert (
        by_method(rows[rows.against == "sidm"], 4).set_index("method").half["mirrored"]
        == "not all run"
    )


def test_where_nothing_is_known_there_is_no_line(frame):
    assert len(table(frame[frame.system == "system2"], ["mirrored"])) == 0
    assert len(by_method(table(frame[:0], ["mirrored"]), 4)) == 0
