"""Seconds a sample: measured, stored and read, and applied to a trial's samples."""

import dataclasses

import pytest

from companion import Study
from companion.engine.frame import frame_of
from companion.studies.throughput import (
    Pace,
    measure,
    pace_note,
    read,
    seconds,
    time_training,
)
from sidm.learning import training


@pytest.fixture
def study(tiny, data, tmp_path):
    """The tiny study with phases of a few iterations."""
    return Study(tiny.replace(prediction_iterations=4, test_interval=2), data, tmp_path)


def test_the_stretch_holds_one_phase_of_each_algorithm(study, monkeypatch):
    """The first test is at iteration 2.

    The phase of Algorithm 2 follows iteration 4, and iteration 6 ends the stretch.
    """
    phases, regularise = [], training.regularisation_phase

    def counted(trainer):
        phases.append(trainer.iteration)
        regularise(trainer)

    monkeypatch.setattr(training, "regularisation_phase", counted)
    (trial,) = study.points("system1", ["sidm"], [0.25], seeds=1)
    assert time_training(trial, study.data) > 0 and phases == [4]


def test_what_is_measured_is_read(study, tmp_path):
    assert read(tmp_path, study.preset.name) == {}
    assert "not measured" in pace_note(tmp_path, study.preset.name, "companion run")
    measure(study, tmp_path, ["sidm", "pretrain_finetune"], rounds=2, beside="a film")
    note = pace_note(tmp_path, study.preset.name, "companion run")
    assert "in 2 rounds, on one core" in note and "beside a film" in note
    stored = read(tmp_path, study.preset.name)
    assert (
        set(stored) == {"sidm", "pretrain_finetune"} and read(tmp_path, "paper") == {}
    )
    assert all(0 < pace.lowest < pace.median < pace.highest for pace in stored.values())


def test_samples_take_their_own_pace(study, make_row):
    """Pretraining has the pace of one system alone; the made-up row has 300 samples."""
    paces = {
        "sidm": Pace(4.0, 3.0, 5.0),
        "pretrain_finetune": Pace(3.0, 2.0, 4.0),
        "novice_only": Pace(2.0, 1.0, 3.0),
    }
    row = make_row(study.trial("system1", "pretrain_finetune", 0.25))
    row = dataclasses.replace(
        row, outcome=dataclasses.replace(row.outcome, pretraining_samples=1000)
    )
    rows = frame_of([row, make_row(study.trial("system1", "sidm", 0.25))])
    assert list(seconds(rows, paces)) == pytest.approx([0.3 * 3 + 1.0 * 2, 0.3 * 4])
    assert seconds(rows, {}).isna().all()
