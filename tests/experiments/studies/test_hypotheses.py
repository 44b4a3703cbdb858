"""Each suspect beside SIDM as it is: paired ratios, verdicts by rule, what was learnt by heart."""

import dataclasses

import numpy as np
import pytest

from sidm.experiments import Results, Study, load_preset
from sidm.experiments.statistics.claims import NO_VERDICT
from sidm.experiments.studies.hypotheses import (
    ADVERSARY,
    APART,
    BETTER,
    CROSSED,
    NO_DIFFERENCE,
    WORSE,
    grid,
    judged,
    learnt,
    not_run,
    suspects,
)

STUDY = Study(load_preset("laptop"))


def test_verdicts_follow_the_interval():
    sidm = np.array([1.0, 1.1, 1.2])
    for factor, said in ((0.5, BETTER), (2.0, WORSE), (1.0, NO_DIFFERENCE)):
        one = judged("", "system1", 5.0, "", np.stack([sidm, factor * sidm], axis=1))
        assert one.verdict == said and one.ratio == pytest.approx([factor] * 3)
    noisy = judged("", "system1", 5.0, "", np.stack([sidm, [2.0, 0.5, 1.0]], axis=1))
    assert noisy.verdict == NO_DIFFERENCE and noisy.ratio.low < 1 < noisy.ratio.high
    assert judged("", "system1", 5.0, "", np.array([[1.0, 0.5], [1.0, 0.6]])).verdict == NO_VERDICT


def test_every_suspect_is_another_trial_than_sidms():
    base = {t.key for t in STUDY.points("system1", ["sidm"], STUDY.preset.novice_minutes("system1"))}
    changes = list(grid(STUDY, "system1"))
    points = [(c.instead, t.novice_minutes, t.seed) for c in changes for t in c.trials]
    assert len(set(points)) == len(points) and len(changes) > 20
    for change in changes:
        assert change.trials and not base & {t.key for t in change.trials}, change.instead


def test_the_figure_that_runs_a_change_has_its_trials():
    from sidm.experiments import grid as figure

    for change in grid(STUDY, "system2"):
        known = {trial.key for trial in figure(STUDY.preset, change.figure, "system2")}
        assert {trial.key for trial in change.trials} <= known, change.instead


def test_what_is_missing_is_counted(make_row, tmp_path):
    """By suspect and figure; a model that was diagnosed instead is not missing."""
    store = Results(tmp_path)
    before = not_run(STUDY, store, systems=["system1"])
    for trial in STUDY.points("system1", ["pooled"], [5]):
        store.put(make_row(trial, 1.0))

    @dataclasses.dataclass
    class Found:
        trial: object

    apart = [Found(t) for t in STUDY.points("system1", ["no_regularisation"], [5])]
    after = not_run(STUDY, store, apart, ["system1"])
    assert after[APART]["baselines"] == before[APART]["baselines"] - 3
    assert after[ADVERSARY]["baselines"] == before[ADVERSARY]["baselines"] - 3


def test_only_what_is_stored_has_a_line(make_row, tmp_path):
    """Seeds pair: what a seed adds to both is no noise; a seed that one side lacks is left out."""
    store = Results(tmp_path)
    for trial in STUDY.points("system1", ["sidm", "pooled"], [5]):
        if (trial.method, trial.seed) != ("pooled", 2):
            store.put(make_row(trial, (1 + trial.seed) * (0.5 if trial.method == "pooled" else 1)))
    (one,) = suspects(STUDY, store)
    assert (one.system, one.minutes, one.seeds, one.verdict) == ("system1", 5, 2, NO_VERDICT)
    assert one.ratio.value == pytest.approx(0.5) and one.instead == "one network"


def test_parts_of_the_experts_are_suspects_too(make_row, tmp_path):
    @dataclasses.dataclass
    class Found:
        trial: object
        validation_loss: float = 2.0
        expert_encoder_loss: float = 1.0
        expert_decoder_loss: float = 4.0
        expert_path_loss: float = 2.0

    found = [Found(t) for t in STUDY.points("system2", ["sidm", "no_regularisation"], [20])]
    lines = suspects(STUDY, Results(tmp_path), found, ["system2"])
    assert {one.suspect for one in lines} == {APART}
    assert [one.instead for one in lines] == [CROSSED[name] for name in (
        "expert_encoder_loss", "expert_path_loss", "expert_decoder_loss"
    )]  # fmt: skip
    assert [one.ratio.value for one in lines] == pytest.approx([0.5, 1.0, 2.0])
    assert {one.seeds for one in lines} == {3}


def test_a_diagnosed_model_stands_in_for_a_trial(make_row, tmp_path):
    """The diagnosis trained what the trial would: its loss is the trial's where no row is stored."""

    @dataclasses.dataclass
    class Found:
        trial: object
        validation_loss: float = 0.5

    store = Results(tmp_path)
    for trial in STUDY.points("system1", ["sidm"], [5]):
        store.put(make_row(trial, 1.0))
    found = [Found(t) for t in STUDY.points("system1", ["no_regularisation"], [5])]
    (one,) = suspects(STUDY, store, found, ["system1"])
    assert (one.suspect, one.instead, one.seeds, one.ratio.value) == (ADVERSARY, "SIDM, no adversary", 3, 0.5)


def test_what_was_learnt_by_heart(make_row):
    """The training loss is that about the weights that were kept: before the patience, or the lowest smoothed loss."""
    rows, stopped = [], []
    for trial in STUDY.points("system1", ["novice_only", "sidm"], [5]):
        row = make_row(trial, 3.0)
        tests, trainings = (3.0, 1.0, 2.0, 1.2, 1.2, 3.0), (9.0, 5.0, 4.0, 3.0, 2.0, 1.0)
        curve = dict(curve_samples=(1, 2, 3, 4, 5, 6), curve_test_loss=tests, curve_training_loss=trainings)
        for some, samples in ((rows, trial.training.max_samples), (stopped, 3 + trial.training.patience)):
            some.append(dataclasses.replace(row, outcome=dataclasses.replace(row.outcome, samples=samples, **curve)))
    assert {one.training for one in learnt(stopped)} == {4.0}
    lines = learnt(rows)
    assert [one.method for one in lines] == ["sidm", "novice_only"]
    assert {(one.minutes, one.training, one.validation) for one in lines} == {(5, 2.0, 3.0)}
