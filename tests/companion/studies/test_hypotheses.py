"""Each hypothesis beside unchanged SIDM: paired ratios, verdicts, training losses."""

import dataclasses

import pandas as pd
import pytest

from companion import Results, Study, load_preset
from companion import grid as figure
from companion.engine.frame import frame_of
from companion.studies import hypotheses as h

STUDY = Study(load_preset("laptop"))


@pytest.fixture
def store(make_row, tmp_path):
    """Results of four hypotheses with known ratios.

    One network halves the loss; stronger matching doubles it; MMD changes nothing but
    adds noise; CORAL has two seeds.
    """
    factors = {
        "sidm": (1, 1, 1),
        "pooled": (0.5, 0.5, 0.5),
        "strong_matching": (2, 2, 2),
        "mmd": (0.8, 1.2, 1.05),
        "coral": (0.5, 0.6),
    }
    store = Results(tmp_path)
    for trial in STUDY.points("system1", list(factors), [5]):
        if trial.seed < len(factors[trial.method]):
            store.put(
                make_row(trial, factors[trial.method][trial.seed] * (1 + trial.seed))
            )
    return store


def test_verdicts_follow_the_interval(store):
    """Seeds are paired, so their common factor adds no noise.

    Fewer than three seeds give no verdict.
    """
    table = h.table(h.frame(STUDY, store, ["system1"]), store.folder).set_index(
        "change"
    )
    assert list(table.ratio) == sorted(table.ratio) and set(table.novice_minutes) == {5}
    assert table.verdict.to_dict() == {
        "joint training (one network)": "better",
        "SIDM, CORAL": "No verdict",
        "SIDM, MMD": "no difference seen",
        "SIDM, stronger matching": "worse",
    }
    assert table.ratio["joint training (one network)"] == pytest.approx(0.5)
    assert table.seeds["SIDM, CORAL"] == 2


def test_changes_are_ranked_by_what_they_gain(store):
    ranking = h.ranking(
        h.table(h.frame(STUDY, store, ["system1"]), store.folder)
    ).set_index("change")
    expected = ["joint training (one network)", "SIDM, MMD", "SIDM, stronger matching"]
    assert list(ranking.index) == expected
    assert list(ranking.better) == [1, 0, 0] and list(ranking.worse) == [0, 0, 1]
    assert ranking.hypothesis["joint training (one network)"] == h.APART
    assert set(ranking.comparisons) == {1}


def test_nothing_stored_is_an_empty_table(tmp_path):
    table = h.table(h.frame(STUDY, Results(tmp_path), ["system1", "system2"]), tmp_path)
    assert len(table) == 0 and len(h.ranking(table)) == 0


def test_every_change_is_another_trial_than_sidms():
    base = {
        t.key
        for t in STUDY.points(
            "system1", ["sidm"], STUDY.preset.novice_minutes("system1")
        )
    }
    changes = list(h.changes(STUDY, "system1"))
    points = [(c.change, t.novice_minutes, t.seed) for c in changes for t in c.trials]
    assert len(set(points)) == len(points) and len(changes) > 20
    for change in changes:
        assert change.trials and not base & {t.key for t in change.trials}, (
            change.change
        )


def test_the_figure_that_runs_a_change_has_its_trials():
    for change in h.changes(STUDY, "system2"):
        known = {trial.key for trial in figure(STUDY.preset, change.figure, "system2")}
        assert {trial.key for trial in change.trials} <= known, change.change


def test_parts_of_the_experts_are_held_against_the_novices_own():
    losses = {
        "validation_loss": 2.0,
        "expert_encoder_loss": 1.0,
        "expert_decoder_loss": 4.0,
        "expert_path_loss": 2.0,
    }
    models = [
        losses | {"system": "system2", "novice_minutes": 20.0, "seed": seed}
        for seed in range(3)
    ]
    lines = h.crossings(pd.DataFrame(models)).set_index("change")
    assert lines.ratio.to_dict() == pytest.approx(
        dict(zip(h.CROSSED.values(), (0.5, 2.0, 1.0), strict=True))
    )
    assert set(lines.seeds) == {3}


def test_what_was_learnt_by_heart(make_row):
    """The training loss is that near the kept weights.

    These are the weights before the patience, or of the lowest smoothed loss.
    """
    rows, stopped = [], []
    for trial in STUDY.points("system1", ["novice_only", "sidm"], [5]):
        row = make_row(trial, 3.0)
        tests = (3.0, 1.0, 2.0, 1.2, 1.2, 3.0)
        trainings = (9.0, 5.0, 4.0, 3.0, 2.0, 1.0)
        curve = dict(
            curve_samples=(1, 2, 3, 4, 5, 6),
            curve_test_loss=tests,
            curve_training_loss=trainings,
        )
        for some, samples in (
            (rows, trial.training.max_samples),
            (stopped, 3 + trial.training.patience),
        ):
            some.append(
                dataclasses.replace(
                    row,
                    outcome=dataclasses.replace(row.outcome, samples=samples, **curve),
                )
            )
    assert set(h.memorised(frame_of(stopped)).training) == {4.0}
    table = h.memorised(frame_of(rows))
    assert list(table.method) == ["sidm", "novice_only"]
    assert set(table.training) == {2.0}
    assert set(table.validation) == {3.0}
    assert set(table.ratio) == {1.5}
