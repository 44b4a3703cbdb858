"""Bundles of stored trials, failures that are kept, and event files."""

import dataclasses
import shutil
from concurrent.futures import ThreadPoolExecutor

import pytest

from companion import Failure, Results, run, run_trial
from companion.__main__ import main
from companion.engine import bundles as bundled
from companion.engine.bundles import bundles, fits
from companion.engine.run import checkpoint_folder, run_here
from sidm.config import ConfigError
from sidm.learning import TrainingError


def diverging(trial):
    """The same trial with learning rates that make the loss infinite."""
    return trial.replace(
        training=dataclasses.replace(trial.training, learning_rate=1e11)
    )


def test_a_bundle_stores_what_trials_alone_give(study, data, tmp_path):
    """All methods and sizes train side by side in two slots.

    Results agree but for rounding.
    """
    trials = study.figure3("system1")
    assert all(map(fits, trials)) and sorted(map(len, bundles(trials))) == [2, 4]
    store = run(trials, data=data, results=tmp_path, progress=False, bundle=2)
    for trial, row in zip(trials, store.rows(trials), strict=True):
        alone = run_trial(trial, data).outcome
        assert row.provenance.bundle == 2
        assert "bundle" in row.provenance.numerics
        assert not row.provenance.stale
        assert row.outcome.validation_loss == pytest.approx(
            alone.validation_loss, rel=1e-3
        )
        assert row.outcome.curve_test_loss == pytest.approx(
            alone.curve_test_loss, rel=1e-3
        )
        # grows over 25 steps
        assert row.outcome.position_error == pytest.approx(
            alone.position_error, rel=0.1
        )
        assert (row.outcome.samples, row.outcome.pretraining_samples) == (
            alone.samples,
            alone.pretraining_samples,
        )
        assert not checkpoint_folder(data, trial, "bundle").exists()


def test_what_goes_into_one_bundle(study):
    """A bundle has one system, network, loop and pretraining; the longest go first."""
    trials = study.figure3("system1") + study.figure3("system2")
    other = trials[0].replace(training=dataclasses.replace(trials[0].training, batch=5))
    groups = bundles([*trials, other])
    assert sorted(map(len, groups)) == [1, 1, 2, 2, 4] and [other] in groups
    expected = [0.75, 0.75, 0.25, 0.25]
    assert [trial.novice_minutes for trial in max(groups, key=len)] == expected


@pytest.mark.parametrize("bundle", [0, 2])
def test_a_failure_is_kept_and_not_repeated(study, data, tmp_path, capsys, bundle):
    """A failure is stored with its iteration, and the other trials go on.

    The trial is tried again with other code or after its file was deleted.
    """
    good, bad = study.figure3("system1")[1], diverging(study.figure3("system1")[0])
    with ThreadPoolExecutor(1) as pool:
        options = dict(
            executor=None if bundle else pool,
            data=data,
            results=tmp_path,
            progress=False,
            bundle=bundle,
        )
        store = run([bad, good], **options)
        assert store.missing([bad, good]) == [bad]
        (failure,) = store.failures([bad, good])
        assert failure.trial == bad
        assert failure.loss in ("nan", "inf")
        assert failure.iteration == 5
        message = (
            f"companion: {bad}: failed, the {failure.what} loss was {failure.loss} "
            "after 5 iterations"
        )
        assert capsys.readouterr().err.strip() == message
        written = store.failed.lines.path.stat().st_mtime_ns
        run([bad], **options)
        assert "not run again unless" in capsys.readouterr().err
    assert store.failed.lines.path.stat().st_mtime_ns == written


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
        return dataclasses.replace(
            true(trial, *rest), best_test_loss=float("nan" if trial == infinite else 1)
        )

    monkeypatch.setattr(bundled, "outcome_of", evaluate)
    trials = [damaged, infinite, good]
    store = run(trials, data=data, results=tmp_path, progress=False, bundle=4)
    shutil.rmtree(folder)
    assert store.missing(trials) == [damaged, infinite]
    errors = capsys.readouterr().err.strip().splitlines()
    assert len(errors) == 2
    for words in ("the checkpoint is damaged", "a number is not finite"):
        assert sum(words in line for line in errors) == 1


def test_a_later_success_replaces_a_failure(study, data, tmp_path, make_row):
    """A failure of other code does not count."""
    trial, store = diverging(study.figure3("system1")[0]), Results(tmp_path)
    with pytest.raises(TrainingError, match="after 5 iterations"):
        run_here(trial, data, store, progress=False)
    (failure,) = store.failures([trial])
    old = dataclasses.replace(
        failure,
        provenance=dataclasses.replace(failure.provenance, numerics={"bundle": 0}),
    )
    assert isinstance(old, Failure)
    store.put(old)
    assert store.failed.get(trial) == old and store.failures([trial]) == []
    store.put(make_row(trial))
    assert store.failed.get(trial) is None and store.missing([trial]) == []


def test_the_command_line(tiny, study, data, tmp_path, capsys, monkeypatch):
    """`run --bundle` stores results; `show` names failures."""
    monkeypatch.setattr("companion.commands._preset", lambda _: tiny)
    common = (
        f"--preset smoke --data {data} --results {tmp_path} --system system1".split()
    )
    trials = study.figure3("system1")
    store = Results(tmp_path)
    with pytest.raises(TrainingError):
        run_here(diverging(trials[0]), data, store, progress=False)
    store.put(
        dataclasses.replace(store.failures([diverging(trials[0])])[0], trial=trials[0])
    )
    assert main(["show", *common]) == 0
    assert f"note: {trials[0]}: failed" in capsys.readouterr().out
    store.failed.lines.drop(trials[0].key)
    assert main(["run", *common, "--bundle", "4"]) == 0
    assert "6 of 6 trials stored" in capsys.readouterr().out
    with pytest.raises(ConfigError, match="bundle must not be negative"):
        run([], bundle=-1, results=tmp_path)
