"""Results as one table."""

import pandas as pd
import pytest

from companion import Results
from companion.__main__ import main
from companion.engine.frame import columns, numbers_and_words
from companion.registry import STUDIES
from tests.companion.conftest import RESULTS


@pytest.fixture
def store(study, make_row, tmp_path):
    """Results of three seeds of three methods, one of them pretrained."""
    store = Results(tmp_path)
    methods = ["sidm", "novice_only", "pretrain_finetune"]
    for number, trial in enumerate(study.points("system1", methods, [0.25], seeds=3)):
        store.put(make_row(trial, 1.0 + number))
    return store


def test_every_value_of_a_row_is_a_column(store, study, tmp_path):
    """Every column says what it is; a file has those that fit in a cell."""
    frame = store.frame(curves=True)
    names = [name for name, _, _ in columns()]
    assert list(frame.columns) == names and len(set(names)) == len(names)
    assert frame.index.is_unique and not frame.stale.any()
    for row in store.all():
        line, trial = frame.loc[row.trial.key], row.trial
        assert line.validation_loss == row.outcome.validation_loss
        assert (line.seed, line.pixels) == (trial.seed, trial.network.pixels)
        assert line.learning_rate == trial.training.learning_rate
        assert line.component_losses == row.outcome.component_losses
        assert line.date == row.provenance.date
        assert pd.isna(line.pretraining_batch) == (trial.pretraining is None)
    assert all(kind and words for _, kind, words in columns())
    meanings = {name: words for name, _, words in columns()}
    assert "min" in meanings["novice_minutes"]
    assert meanings["own"].endswith("as if the system were an input")
    more = study.points("system1", ["sidm"], [0.25], seeds=5)
    assert list(store.frame(more).seed) == [0, 1, 2]  # what is not stored has no line
    assert len(Results(tmp_path / "empty").frame()) == 0
    table = numbers_and_words(store.frame())
    assert "validation_loss" in table and "component_losses" not in table


def test_show_writes_a_table(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments = ["--preset", "smoke", "--results", str(tmp_path), "--csv", "mine.csv"]
    assert main(["show", *arguments]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-2] == "table: mine.csv" and lines[-1] == "missing: 12"
    assert "validation_loss" in pd.read_csv("mine.csv").columns


def test_records_are_a_table_too():
    records = STUDIES["uncertainty"].module.records(RESULTS)
    frame, stored = records.frame(), records.all()
    seeds = [record.about.trial.seed for record in stored]
    assert list(frame.seed) == seeds != []
    assert list(frame.date) == [record.provenance.date for record in stored]
    assert len(records.frame([stored[0].about])) == 1
