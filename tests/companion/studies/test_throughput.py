"""Seconds a sample: measured, stored and read, and applied to a trial's samples."""

import dataclasses

import pytest

from companion import Study
from companion.engine.frame import frame_of
from companion.registry import MEASUREMENTS
from companion.studies import throughput
from companion.studies.throughput import pace_note, read, seconds, time_training
from sidm.learning import training


@pytest.fixture
def study(tiny):
    """The tiny study with phases of a few iterations."""
    return Study(tiny.replace(prediction_iterations=4, test_interval=2))


def test_the_stretch_holds_one_phase_of_each_algorithm(study, data, monkeypatch):
    """From the first test, at iteration 2, to iteration 6."""
    phases, regularise = [], training.regularisation_phase

    def counted(trainer):
        phases.append(trainer.iteration)
        regularise(trainer)

    monkeypatch.setattr(training, "regularisation_phase", counted)
    (trial,) = study.points("system1", ["sidm"], [0.25], seeds=1)
    assert time_training(trial, data) > 0 and phases == [4]


def test_what_is_measured_is_read(study, data, tmp_path, monkeypatch):
    name, methods = study.preset.name, ["sidm", "pretrain_finetune"]
    assert read(tmp_path, name) == {}
    assert "not measured" in pace_note(tmp_path, name, "companion run")
    monkeypatch.setattr(throughput, "TRAINED", methods)
    monkeypatch.setattr(throughput, "ROUNDS", 2)
    MEASUREMENTS["throughput"].run(study, None, 1, data, tmp_path)
    note = pace_note(tmp_path, name, "companion run")
    assert "in 2 rounds, on one core" in note and "beside what else" in note
    stored = read(tmp_path, name)
    assert {*stored} == {*methods} and read(tmp_path, "paper") == {}
    assert all(pace > 0 for pace in stored.values())


def test_pretraining_has_the_pace_of_one_system_alone(study, make_row):
    paces = {"sidm": 4.0, "pretrain_finetune": 3.0, "novice_only": 2.0}
    tuned, sidm = (
        make_row(study.trial("system1", method, 0.25))  # of 300 samples
        for method in ("pretrain_finetune", "sidm")
    )
    outcome = dataclasses.replace(tuned.outcome, pretraining_samples=1000)
    rows = frame_of([dataclasses.replace(tuned, outcome=outcome), sidm])
    assert list(seconds(rows, paces)) == pytest.approx([0.3 * 3 + 1.0 * 2, 0.3 * 4])
    assert seconds(rows, {}).isna().all()
