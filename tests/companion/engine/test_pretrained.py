"""Pretrained weights are made once for all sizes; damaged ones are named."""

import pytest

from companion import METHODS, PRESETS, Study, run, run_trial
from companion.engine import pretrained
from sidm.config import ConfigError, replace


@pytest.fixture
def trials(study):
    """Both sizes of one seed."""
    sizes = study.preset.novice_minutes("system1")
    return study.points("system1", ["pretrain_finetune"], sizes)


def test_the_weights_are_made_once(trials, data):
    """Both sizes share the weights; the outcome counts the expert's samples."""
    first = run_trial(trials[0], data).outcome
    (folder,) = {pretrained.pretrained_folder(trial, data) for trial in trials}
    written = (folder / "checkpoint.npz").stat().st_mtime_ns
    second = run_trial(trials[1], data).outcome
    assert (folder / "checkpoint.npz").stat().st_mtime_ns == written
    assert not (folder / "state").exists()
    samples = first.pretraining_samples
    assert samples == second.pretraining_samples >= trials[0].pretraining.max_samples
    assert first == run_trial(trials[0], data).outcome != second


def test_damaged_weights_are_named(trials, data, tmp_path, capsys):
    trial = trials[0].replace(seed=7)
    where = pretrained.pretrained_folder(trial, data, "bundle")
    where.mkdir(parents=True)
    (where / "checkpoint.npz").write_bytes(b"no archive")
    options = dict(data=data, results=tmp_path, progress=False, bundle=1)
    assert run([trial], **options).missing([trial])
    assert "the checkpoint is damaged" in capsys.readouterr().err


def test_a_pretraining_has_the_expert_alone(trials):
    """The expert takes the novice's place.

    The correction of a frozen model has no expert beside it.
    """
    both = replace(trials[0].training, p_expert=0.5)
    with pytest.raises(ConfigError, match="has the expert in the novice's place"):
        trials[0].replace(pretraining=both)
    for changes in ({"training": both}, {"pretraining": None}):
        with pytest.raises(ConfigError, match="residual goes with a pretraining"):
            trials[0].replace(residual=True, **changes)
    assert trials[0].replace(training=both).training.needs_expert


def test_what_was_tuned_yields_to_what_is_asked_for(tiny):
    """A method takes its tuned value; a value given by hand holds for all methods."""
    for preset in PRESETS.values():
        assert {method for method, _, _ in preset.tuned} <= {*METHODS, "pretraining"}

    def rates(preset):
        study = Study(preset)
        sidm = study.trial("system1", "sidm", 0.25)
        tuned = study.trial("system1", "pretrain_finetune", 0.25)
        parts = sidm.training, tuned.training, tuned.pretraining
        return [part.learning_rate for part in parts]

    tuned = tiny.replace(
        tuned=(("sidm", "learning_rate", 1e-4), ("pretraining", "learning_rate", 1e-2))
    )
    assert rates(tuned) == [1e-4, 1e-3, 1e-2]
    assert rates(tuned.replace(learning_rate=0.5)) == [0.5, 0.5, 0.5]


def test_a_pretraining_that_fails_is_kept(trials, data, tmp_path):
    """Its failure is stored with the iteration; trials of other weights go on."""
    diverging = replace(trials[0].pretraining, learning_rate=1e11)
    bad = trials[0].replace(seed=5, pretraining=diverging)
    options = dict(data=data, results=tmp_path, progress=False, bundle=1)
    store = run([bad, trials[1]], **options)
    assert store.missing([bad, trials[1]]) == [bad]
    (failure,) = store.failures([bad])
    assert failure.loss in ("nan", "inf") and failure.iteration > 0


def test_kept_weights_are_named_by_values_and_not_by_how_they_print(
    trials, tmp_path, monkeypatch
):
    trial = trials[0]

    def folder(network):
        settings = pretrained.settings_of(network, trial.pretraining)
        return pretrained.weights_folder(tmp_path, settings, "training", "a-")

    before = folder(trial.network)
    monkeypatch.setattr(type(trial.network), "__repr__", lambda _: "another text")
    assert folder(trial.network) == before and before.name.startswith("a-")
    assert folder(replace(trial.network, hidden=7)) != before
