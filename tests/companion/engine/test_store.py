"""The store returns rows as they were stored and reads nothing damaged."""

import pandas as pd
import pytest

from companion import Failure, Results, StoreError, Study
from companion.__main__ import main
from companion.engine import known_motion
from companion.engine.frame import frame_of
from companion.engine.known_motion import Known, OtherMotion
from companion.engine.lines import line_of, values_of
from companion.numerics import RESULT_VERSIONS
from sidm.config import replace
from sidm.systems import FREE_SYSTEMS
from tests.companion.conftest import RESULTS


@pytest.fixture
def trials(tiny):
    """Four trials of a tiny study."""
    return Study(tiny).figure3("system1")


@pytest.fixture
def store(tmp_path):
    return Results(tmp_path)


@pytest.fixture
def row_of(make_row):
    """Function that makes a row whose provenance has some values changed."""

    def row_of(trial, loss=2.0, **changes):
        row = make_row(trial, loss)
        return replace(row, provenance=replace(row.provenance, **changes))

    return row_of


def losses(store, trials):
    return [row.outcome.validation_loss for row in store.stored(trials)]


def test_rows_come_back(trials, make_row, store, tmp_path):
    """A row is read as stored, to 6 significant digits; its curves lie beside it."""
    row = make_row(trials[0], loss=2.123456789)
    path = store.put(row)
    assert path == tmp_path / "trials.jsonl" and len(path.read_bytes()) < 4000
    back = store.get(trials[0])
    assert back.outcome.validation_loss == 2.12346
    assert back.outcome.curve_test_loss == (3.0, 2.5, 2.33580)
    assert (back.trial, back.provenance) == (row.trial, row.provenance)
    store.put(make_row(trials[1]))
    store.put(make_row(trials[0], loss=3.0))  # in the first one's place
    assert losses(store, trials) == [3.0, 2.0]
    assert len(path.read_text().splitlines()) == 2
    assert not list(tmp_path.glob("*.part"))


def test_what_was_never_finished_is_no_row(trials, make_row, store):
    """A writer was killed in the middle of a line, or of curves; the next one mends."""
    path = store.put(make_row(trials[0]))
    whole = path.read_bytes()
    for part in (10, len(whole) - 1):
        path.write_bytes(whole + whole[:part])
        with open(store.curves_path, "ab") as file:
            file.write(b"half a curve")
        assert store.missing(trials) == trials[1:]
        store.put(make_row(trials[1], 5.0))
        assert losses(store, trials) == [2.0, 5.0]
        assert store.get(trials[1]).outcome.curve_samples == (100, 200, 300)
        path.write_bytes(whole)


def test_a_table_has_curves_where_it_is_asked_for_them(trials, make_row, store):
    store.put(make_row(trials[0]))
    short, whole = store.frame(trials), store.frame(trials, curves=True)
    assert "curve_samples" not in short and "validation_loss" in short
    assert whole.curve_samples.tolist() == [(100, 200, 300)]
    pd.testing.assert_frame_equal(whole, frame_of(store.stored(trials)))
    store.curves_path.write_bytes(b"")
    assert len(store.frame(trials)) == 1
    with pytest.raises(StoreError, match="curves.gz, byte 0: .*delete the line"):
        store.frame(trials, curves=True)


def test_rows_of_different_motion_make_no_table(trials, row_of, store, tmp_path):
    """But for motion that is known to differ by rounding alone."""
    for trial, digest in zip(trials, ("aa", "bb"), strict=False):
        store.put(row_of(trial, digests={"the expert's": digest}))
    with pytest.raises(OtherMotion, match="the expert's .* aa and bb; .*--verify"):
        store.frame()
    known_motion.note([Known(name="the expert's", digest="aa", same=("bb",))], tmp_path)
    assert store.frame(trials).repeated.tolist() == [False, True]


@pytest.mark.parametrize(
    "numerics",
    [
        {"training": 0},
        {"simulation": RESULT_VERSIONS["simulation"], "a kind that was": 1},
    ],
)
def test_rows_of_other_versions_are_stale(trials, row_of, store, numerics):
    """A row of today's versions counts, whatever files made it; an older one lacks."""
    store.put(row_of(trials[0], source="0" * 12))
    store.put(row_of(trials[1], numerics=numerics))
    assert [row.provenance.stale for row in store.stored(trials)] == [False, True]
    assert store.missing(trials) == trials[1:]


def test_no_stored_row_is_stale():
    """After a version was raised, its rows were made again or confirmed by a sample."""
    rows = Results(RESULTS).all()
    assert len(rows) > 600 and not any(row.provenance.stale for row in rows)
    free = [row.provenance.numerics for row in rows if row.trial.system in FREE_SYSTEMS]
    assert len(free) > 100 and all("free_struts" in numerics for numerics in free)


@pytest.mark.parametrize(
    "spoil, words",
    [
        (lambda values: values.pop("outcome"), "damaged .*outcome"),
        (lambda values: values.update(trial=[]), "must be Trial, not list"),
        (lambda values: values["trial"].update(seed=7), "is about something else"),
        (lambda values: values["outcome"].update(iters=3), "unknown name 'iters'"),
        (None, "line 1: its checksum does not match"),
    ],
)
def test_what_is_not_the_row_is_named_in_one_line(
    trials, make_row, store, spoil, words
):
    """Whatever the line contains, the error names the file and what to do."""
    path = store.put(make_row(trials[0]))
    if spoil is None:
        path.write_text(path.read_text().replace("system1", "system2", 1))
    else:
        values = values_of(path.read_text().strip())
        spoil(values)
        path.write_text(line_of(values))
    with pytest.raises(StoreError, match=words) as caught:
        store.get(trials[0])
    message = str(caught.value)
    assert str(path) in message and "\n" not in message
    assert "delete the line" in message


def test_what_was_drawn_of_motion_made_again_goes_with_the_rest(tmp_path, trials):
    """The digest is of a part, and the whole motion of the robot is compared."""
    seen = [{"pool/1125, 5 min, seed 0": digest} for digest in ("one", "other")]
    known_motion.refuse_mixed(seen, tmp_path)
    with pytest.raises(OtherMotion, match="rows of pool/1125 were made with different"):
        known_motion.refuse_mixed([{"pool/1125": "a"}, {"pool/1125": "b"}], tmp_path)


def test_a_store_takes_in_what_it_lacks(tmp_path, trials, row_of, capsys):
    """Existing rows of today's versions stay; digests and failures come, too."""
    store, other = Results(tmp_path / "mine"), Results(tmp_path / "other")
    store.put(row_of(trials[0], 1.0))
    for trial in trials[:2]:
        other.put(row_of(trial, 2.0))
    made = row_of(trials[2]).provenance
    failed = Failure(
        trial=trials[2], what="test", loss="nan", iteration=3, provenance=made
    )
    other.put(failed)
    known_motion.note([Known(name="the expert's", digest="0123")], other.folder)
    merge = ["merge", str(other.folder), "--results", str(store.folder)]
    assert main(merge) == 0
    assert capsys.readouterr().out == "1 results taken in\n"
    assert losses(store, trials) == [1.0, 2.0] and store.failed.all() == [failed]
    assert known_motion.read(store.folder)["the expert's"].digest == "0123"
    for older in (store, other):
        older.put(row_of(trials[0], numerics={"training": 0}))
        current = Results(tmp_path / "current")
        current.put(row_of(trials[0], 3.0))
        current.take_in(older)
        assert losses(current, trials[:1]) == [3.0]
        assert older.take_in(current) == 1 and older.missing(trials[:1]) == []
    store.failed.path.write_text("no record\n")
    with pytest.raises(StoreError, match="failures.jsonl: damaged"):
        store.put(row_of(trials[1], 1.0))
    store.failed.path.unlink()
    known_motion.note([Known(name="the expert's", digest="45")], store.folder)
    with pytest.raises(OtherMotion, match="the expert's is other motion than that of"):
        store.take_in(other)
    assert main(["merge", str(tmp_path / "nowhere"), "--results", merge[-1]]) == 2
