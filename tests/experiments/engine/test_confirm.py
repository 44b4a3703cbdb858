"""Rows of older versions that today's code would make again."""

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import pytest

from sidm.__main__ import main
from sidm.experiments import Results, Study, run
from sidm.experiments.engine.confirm import ROUNDING, confirm, kind, stale_kinds
from sidm.experiments.methods import change
from sidm.experiments.studies.driving.drive import Drive
from sidm.experiments.studies.uncertainty.fit import Fit


def aged(row, version):
    """A row of an older version of its training."""
    numerics = row.provenance.numerics | {"training": version}
    return dataclasses.replace(row, provenance=dataclasses.replace(row.provenance, numerics=numerics))


@pytest.fixture
def stored(tiny, data, tmp_path):
    """Two sizes of two methods, as if an older version had made them."""
    study, store = Study(tiny, data, tmp_path), Results(tmp_path)
    trials = study.points("system1", ["sidm", "novice_only"], tiny.novice_minutes("system1"))
    with ThreadPoolExecutor(1) as pool:
        run(trials, pool, data=data, results=store, progress=False)
    for row in store.rows(trials):
        store.put(aged(row, 0))
    return trials, store


def test_a_sample_confirms_its_kind(stored, data):
    """One of each method is run again; outcomes stay as they were, rows find their keys."""
    trials, store = stored
    before = [row.outcome for row in store.rows(trials)]
    assert len(store.stale(trials)) == 4 and [len(kind) for kind in stale_kinds(store.rows(trials))] == [2, 2]
    store.path(trials[0]).rename(store.path(trials[0]).with_stem("0" * 20))  # as when a trial had a value less
    with ThreadPoolExecutor(1) as pool:
        assert confirm(trials, store, pool, data, progress=False) == (4, [])
    rows = store.rows(trials)
    assert not store.stale(trials) and [row.outcome for row in rows] == before
    assert not stale_kinds(rows)


def test_a_kind_takes_the_same_ways_through_the_code(stored):
    """Rates and batches may differ; what is chosen, and what is switched on by a number, may not."""
    trial = stored[0][0]
    for same in (dict(learning_rate=0.5), dict(batch=3), dict(patience=7)):
        assert kind(trial.replace(training=change(trial.training, **same), seed=4)) == kind(trial)
    others = [trial.replace(system="system2"), trial.replace(method="mmd")]
    others += [
        trial.replace(training=change(trial.training, **other))
        for other in (dict(weight_decay=0.0), dict(decay="l2"), dict(averaging=0.9), dict(mirror=True))
    ]
    assert len({kind(one) for one in (trial, *others)}) == 7


def test_a_record_is_of_a_kind_by_its_trial_and_by_what_else_it_is_about(stored):
    """Sizes, seeds and which episodes make no difference; what is done does."""
    trials = stored[0]
    fits = [Fit(trial=trial.replace(seed=seed), likelihood=True, particles=8) for trial in trials for seed in (0, 1)]
    assert {kind(fit) for fit in fits} == {kind(fits[0]), kind(fits[-1])} and kind(fits[0]) != kind(fits[-1])
    assert kind(dataclasses.replace(fits[0], likelihood=False)) != kind(fits[0])
    straight = Drive(system="system1", driver="straight", trial=None, planning=None, episodes=(0, 1), longest=20.0)
    assert kind(dataclasses.replace(straight, episodes=(2,))) == kind(straight)
    assert kind(dataclasses.replace(straight, system="system2")) != kind(straight)


def test_rows_of_different_older_versions_are_different_kinds(stored):
    first, second, *_ = stored[1].rows(stored[0])
    assert len(stale_kinds([aged(first, 0), aged(dataclasses.replace(second, trial=first.trial), -1)])) == 2


def test_what_comes_out_otherwise_stays_stale(stored, tiny, data, capsys, monkeypatch):
    """With its kind, by more than rounding; the command says so, with exit status 1."""
    trials, store = stored
    kinds = stale_kinds(store.rows(trials))
    for (row, *_), factor in zip(kinds, (1 + 2 * ROUNDING, 1 + ROUNDING / 2), strict=True):
        outcome = dataclasses.replace(row.outcome, validation_loss=row.outcome.validation_loss * factor)
        store.put(dataclasses.replace(row, outcome=outcome))
    strange = kinds[0][0]
    monkeypatch.setattr("sidm.__main__._preset", lambda _: tiny)
    words = ["confirm", "--data", str(data), "--results", str(store.folder), "--system", "system1", "--workers", "1"]
    assert main(words) == 1
    said = capsys.readouterr().out
    assert f"{strange.trial}: comes out otherwise" in said and "2 rows confirmed" in said
    assert {t.method for t in store.stale(trials)} == {strange.trial.method} and len(store.stale(trials)) == 2
