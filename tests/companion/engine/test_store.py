"""The store returns rows as they were stored and reads nothing damaged."""

import dataclasses

import pytest

from companion import Failure, Results, StoreError, Study
from companion.__main__ import main
from companion.digests import find_digest
from companion.engine.datasets import note_committed
from companion.numerics import NUMERICS
from sidm.storage import read_record, write_record
from sidm.systems import FREE_SYSTEMS
from tests.companion.conftest import RESULTS


@pytest.fixture
def trials(tiny, tmp_path):
    """Four trials of a tiny study."""
    return Study(tiny, tmp_path / "no-data", tmp_path).figure3("system1")


def test_rows_come_back(trials, make_row, tmp_path):
    """A row is read as stored, to 6 significant digits.

    Writing it again changes no byte.
    """
    store, row = Results(tmp_path), make_row(trials[0], loss=2.123456789)
    path = store.put(row)
    assert path == tmp_path / "trials" / f"{trials[0].key}.json"
    back = store.get(trials[0])
    assert back.outcome.validation_loss == 2.12346
    assert back.trial == row.trial
    assert back.provenance == row.provenance
    before = path.read_bytes()
    assert store.put(back).read_bytes() == before and len(before) < 5000
    assert not list(path.parent.glob(".*"))


def test_missing_and_rows(trials, make_row, tmp_path):
    """Stored and missing trials partition the trials, in their order."""
    store = Results(tmp_path)
    assert store.missing(trials) == trials
    assert store.rows(trials) == []
    assert store.get(trials[0]) is None
    for trial in trials[1:3]:
        store.put(make_row(trial))
    assert [row.trial for row in store.rows(trials)] == trials[1:3]
    assert store.missing(trials) == [trials[0], *trials[3:]]
    assert {row.trial.key for row in store.all()} == {
        trial.key for trial in trials[1:3]
    }


@pytest.mark.parametrize(
    "numerics",
    [{"training": 0}, {"simulation": NUMERICS["simulation"], "a kind that was": 1}],
)
def test_rows_of_other_versions_are_stale(trials, make_row, tmp_path, numerics):
    """A row of today's versions counts, whatever files made it; an older one lacks."""
    store, row = Results(tmp_path), make_row(trials[0])
    store.put(
        dataclasses.replace(
            row, provenance=dataclasses.replace(row.provenance, source="0" * 12)
        )
    )
    old = dataclasses.replace(row.provenance, numerics=numerics)
    store.put(dataclasses.replace(row, trial=trials[1], provenance=old))
    assert [row.provenance.stale for row in store.rows(trials)] == [False, True]
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
        (
            lambda values: values.update(schema=99),
            "has schema 99, this version reads 3",
        ),
        (lambda values: values.pop("schema"), "has schema None, this version reads 3"),
        (lambda values: values.update(trial=[]), "must be Trial, not list"),
        (lambda values: values["trial"].update(seed=7), "is about something else"),
        (
            lambda values: values["outcome"].update(iteratons=3),
            "did you mean 'iterations'",
        ),
    ],
)
def test_what_is_not_the_row_is_named_in_one_line(
    trials, make_row, tmp_path, spoil, words
):
    """Whatever the file contains, the error names it and what to do."""
    store = Results(tmp_path)
    path = store.put(make_row(trials[0]))
    values = read_record(path)
    spoil(values)
    write_record(path, values)
    with pytest.raises(StoreError, match=words) as caught:
        store.get(trials[0])
    message = str(caught.value)
    assert str(path) in message and "\n" not in message and "delete it" in message


def test_a_store_takes_in_what_it_lacks(tmp_path, tiny, make_row, capsys):
    """Existing rows of today's versions stay; digests and failures come, too."""
    trials = Study(tiny, tmp_path, tmp_path).figure3("system1")[:3]
    store, other = Results(tmp_path / "mine"), Results(tmp_path / "other")
    store.put(make_row(trials[0], 1.0))
    for trial in trials[:2]:
        other.put(make_row(trial, 2.0))
    other.put(
        Failure(
            trial=trials[2],
            what="test",
            loss="nan",
            iteration=3,
            provenance=make_row(trials[2]).provenance,
        )
    )
    note_committed(trials[0].datasets["expert"], "0123", tmp_path, other.folder)
    assert main(["merge", str(other.folder), "--results", str(store.folder)]) == 0
    assert capsys.readouterr().out == "1 results taken in\n"
    assert [row.outcome.validation_loss for row in store.rows(trials)] == [1.0, 2.0]
    for older in (store, other):
        row = older.get(trials[0])
        old = dataclasses.replace(row.provenance, numerics={"training": 0})
        older.put(dataclasses.replace(row, provenance=old))
        current = Results(tmp_path / "current")
        current.put(make_row(trials[0], 3.0))
        current.take_in(older)
        assert current.get(trials[0]).outcome.validation_loss == 3.0
        assert older.take_in(current) == 1 and older.missing(trials[:1]) == []
    assert store.failed.get(trials[2]).loss == "nan"
    assert (
        find_digest(trials[0].datasets["expert"], tmp_path / "none", store.folder)
        == "0123"
    )
    assert (
        main(["merge", str(tmp_path / "nowhere"), "--results", str(store.folder)]) == 2
    )
