"""Bundles of stored trials, and failures that are kept."""

import dataclasses
import shutil
from concurrent.futures import ThreadPoolExecutor

import pytest

from companion import Results, run, run_trial
from companion.__main__ import main
from companion.engine import bundles as bundled
from companion.engine.bundles import bundles, fits
from companion.engine.run import checkpoint_folder
from companion.methods import ANY_BODIES, FIGURE3
from sidm.config import replace


def diverging(trial):
    """The same trial with learning rates that make the loss infinite."""
    return trial.replace(training=replace(trial.training, learning_rate=1e11))


def test_a_bundle_stores_what_trials_alone_give(study, data, tmp_path):
    """All methods and sizes train side by side in two slots.

    Results agree but for rounding.
    """
    trials = study.figure3("system1")
    assert all(map(fits, trials)) and sorted(map(len, bundles(trials))) == [2, 4]
    store = run(trials, data=data, results=tmp_path, progress=False, bundle=2)
    for trial, row in zip(trials, store.stored(trials), strict=True):
        alone, made, out = run_trial(trial, data).outcome, row.provenance, row.outcome
        assert made.bundle == 2 and "bundle" in made.numerics and not made.stale
        assert out.validation_loss == pytest.approx(alone.validation_loss, rel=1e-3)
        assert out.curve_test_loss == pytest.approx(alone.curve_test_loss, rel=1e-3)
        # grows over 25 steps
        assert out.position_error == pytest.approx(alone.position_error, rel=0.1)
        assert out.samples == alone.samples
        assert out.pretraining_samples == alone.pretraining_samples
        assert not checkpoint_folder(data, trial, "bundle").exists()


def test_what_goes_into_one_bundle(study):
    """A bundle has one system, network, loop and pretraining; the longest go first."""
    trials = study.figure3("system1") + study.figure3("system2")
    other = trials[0].replace(training=replace(trials[0].training, batch=5))
    groups = bundles([*trials, other])
    assert sorted(map(len, groups)) == [1, 1, 2, 2, 4] and [other] in groups
    expected = [0.75, 0.75, 0.25, 0.25]
    assert [trial.novice_minutes for trial in max(groups, key=len)] == expected


def test_bundles_take_methods_of_one_loop_and_leave_others(study, data, tmp_path):
    """What no bundle can train is run alone beside the bundles."""

    def trial(method):
        return study.trial("system1", method, 0.75)

    for method in (*FIGURE3, *ANY_BODIES, "finetune_parts"):
        assert fits(trial(method))
    for method in ("pooled", "mmd", "residual", "expert_only", "least_squares"):
        assert not fits(trial(method))
    trials = [trial("sidm"), trial("pooled")]
    store = run(trials, data=data, results=tmp_path, progress=False, bundle=2)
    assert [row.provenance.bundle for row in store.stored(trials)] == [2, 0]


@pytest.mark.parametrize("bundle", [0, 2])
def test_a_failure_is_kept_and_not_repeated(
    study, data, tmp_path, capsys, bundle, make_row
):
    """A failure is stored with its iteration, and the other trials go on.

    The trial is tried again with other code; a later success replaces the failure.
    """
    good, bad = study.figure3("system1")[1], diverging(study.figure3("system1")[0])
    with ThreadPoolExecutor(1) as pool:
        where = dict(bundle=bundle) if bundle else dict(executor=pool)
        options = dict(data=data, results=tmp_path, progress=False, **where)
        store = run([bad, good], **options)
        assert store.missing([bad, good]) == [bad]
        (failure,) = store.failures([bad, good])
        assert failure.trial == bad and failure.iteration == 5
        assert failure.loss in ("nan", "inf")
        said = f"companion: {bad}: failed, the {failure.what} loss was {failure.loss} "
        assert capsys.readouterr().err.strip() == f"{said}after 5 iterations"
        written = store.failed.path.stat().st_mtime_ns
        run([bad], **options)
        assert "not run again unless" in capsys.readouterr().err
    assert store.failed.path.stat().st_mtime_ns == written
    made = replace(failure.provenance, numerics={"bundle": 0})
    old = replace(failure, provenance=made)
    store.put(old)
    assert store.failed.get(bad) == old and store.failures([bad]) == []
    store.put(make_row(bad))
    assert store.failed.get(bad) is None and store.missing([bad]) == []


def test_one_fault_in_a_bundle_loses_no_other(
    study, data, tmp_path, capsys, monkeypatch
):
    """Each fault is reported in one line.

    Faults are a damaged checkpoint and an outcome that cannot be stored.
    """
    damaged, infinite, good = study.figure3("system1")[:3]
    folder = checkpoint_folder(data, damaged, "bundle")
    folder.mkdir(parents=True)
    (folder / "checkpoint.npz").write_bytes(b"no archive")
    true = bundled.outcome_of

    def evaluate(trial, *rest):
        loss = float("nan" if trial == infinite else 1)
        return dataclasses.replace(true(trial, *rest), best_test_loss=loss)

    monkeypatch.setattr(bundled, "outcome_of", evaluate)
    trials = [damaged, infinite, good]
    store = run(trials, data=data, results=tmp_path, progress=False, bundle=4)
    shutil.rmtree(folder)
    assert store.missing(trials) == [damaged, infinite]
    errors = capsys.readouterr().err.strip().splitlines()
    assert len(errors) == 2
    for words in ("the checkpoint is damaged", "a number is not finite"):
        assert sum(words in line for line in errors) == 1


def test_the_command_line(tiny, study, data, tmp_path, capsys, monkeypatch):
    """`run --bundle` stores results; `show` names failures."""
    monkeypatch.setattr("companion.commands._preset", lambda _: tiny)
    words = f"--preset smoke --data {data} --results {tmp_path} --system system1"
    trial, store = study.figure3("system1")[0], Results(tmp_path)
    run([diverging(trial)], data=data, results=store, progress=False)
    (failure,) = store.failures([diverging(trial)])
    assert "after 5 iterations" in str(failure)
    store.put(replace(failure, trial=trial))
    assert main(["show", *words.split()]) == 0
    assert f"note: {trial}: failed" in capsys.readouterr().out
    store.failed.drop(trial)
    assert main(["run", *words.split(), "--bundle", "4"]) == 0
    assert "6 of 6 trials stored" in capsys.readouterr().out
