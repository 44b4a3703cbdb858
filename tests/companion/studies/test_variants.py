"""Half the data, on losses whose ratio is known."""

import pytest

from companion import Study
from companion.engine.frame import frame_of
from companion.studies import variants
from companion.studies.variants import AGAINST, EQUAL, by_method, table

#: of the data
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
    """Losses fall with the square root of the data; the tethered have two seeds, and no
    one SIDM at 10 min."""

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
    found = table(frame, ["mirrored"])
    assert list(zip(found.novice_minutes, found.against, strict=True)) == [
        (s, o) for s in SIZES for o in AGAINST
    ]
    with_sidm, first = (
        found[found.against == other].set_index("novice_minutes") for other in AGAINST
    )
    assert with_sidm.with_minutes.to_dict() == {1: 2, 2: 5, 5: 20, 10: 20}
    assert first.with_minutes.to_dict() == {1: 2, 2: 5, 5: 10, 10: 20}
    assert first.ratio[1] == pytest.approx((4 * 2 / 16) ** 0.5) and first.high[1] < 1


def test_at_equal_sizes_and_in_other_values(frame):
    other = frame.assign(error=2 * frame.validation_loss)
    found = table(other, ["mirrored"], ["sidm"], EQUAL, "error")
    assert list(found.with_minutes) == [1, 2, 5, 20]
    assert found.ratio[0] == pytest.approx(1 / 4) and found["mean"][0] == pytest.approx(
        2 * 1.01 / 4
    )


def test_a_method_that_saves_less_is_not_sure(frame):
    """Six times the data in effect against four."""
    found = table(frame, ["averaged"]).set_index(["novice_minutes", "against"])
    assert found.high[1, "pretrain_finetune"] > 1 > found.high[1, "sidm"]


def test_the_verdict_needs_every_point(frame):
    found = table(frame, ["mirrored", "averaged", "tethered", "adapters"])
    said = {
        "averaged": ["4 of 4", "0 of 4", "no"],
        "mirrored": ["4 of 4", "4 of 4", "yes"],
    }
    assert by_method(found, 4).set_index("method").T.to_dict("list") == said
    assert by_method(found, 8).set_index("method").half["mirrored"] == "not all run"
    assert (
        by_method(found[found.against == "sidm"], 4)
        .set_index("method")
        .half["mirrored"]
        == "not all run"
    )


def test_where_nothing_is_known_there_is_no_line(frame):
    assert len(table(frame[frame.system == "system2"], ["mirrored"])) == 0
    assert len(by_method(table(frame[:0], ["mirrored"]), 4)) == 0
