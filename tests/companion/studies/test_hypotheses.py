"""Changes beside unchanged SIDM, and the claim about the corrected model."""

import dataclasses

import pandas as pd
import pytest

from companion import Results, Study, load_preset
from companion import grid as figure
from companion.engine.frame import frame_of
from companion.statistics.claims import BETTER, WORSE
from companion.studies import corrected_claim as claim
from companion.studies import hypotheses as h
from companion.studies.latent_space.results import CROSSED, crossings

STUDY = Study(load_preset("laptop"))


def test_changes_have_verdicts_and_are_ranked_by_what_they_gain(make_row, tmp_path):
    """One network halves the loss, stronger matching doubles it, MMD adds noise.

    CORAL has two seeds; seeds are paired, so their common factor adds no noise.
    """
    factors = {
        "sidm": (1, 1, 1),
        "pooled": (0.5, 0.5, 0.5),
        "strong_matching": (2, 2, 2),
        "mmd": (0.8, 1.2, 1.05),
        "coral": (0.5, 0.6),
    }
    store = Results(tmp_path)
    assert not len(h.ranking(h.table(h.frame(STUDY, store, ["system1"]), tmp_path)))
    for trial in STUDY.points("system1", list(factors), [5]):
        if trial.seed < len(factors[trial.method]):
            factor = factors[trial.method][trial.seed]
            store.put(make_row(trial, factor * (1 + trial.seed)))
    table = h.table(h.frame(STUDY, store, ["system1"]), tmp_path)
    assert list(table.ratio) == sorted(table.ratio)
    rows = table.set_index("change")
    assert rows.verdict.to_dict() == {
        "joint training (one network)": "better",
        "SIDM, CORAL": "No verdict",
        "SIDM, MMD": "no difference seen",
        "SIDM, stronger matching": "worse",
    }
    assert rows.ratio["joint training (one network)"] == pytest.approx(0.5)
    ranking = h.ranking(table)
    assert ranking.change.tolist() == [c for c in rows.index if c != "SIDM, CORAL"]
    assert ranking.better.tolist() == [1, 0, 0] and ranking.worse.tolist() == [0, 0, 1]


def test_a_dot_is_filled_where_the_interval_excludes_one():
    """A change with one comparison has no row."""
    names = ["one", "one", "other", "other", "single"]
    table = pd.DataFrame({"change": names, "system": "system1"})
    verdicts = [BETTER, "no difference seen", WORSE, WORSE, BETTER]
    table = table.assign(ratio=[0.5, 0.9, 1.5, 1.6, 0.1], verdict=verdicts)
    (axes,) = h.figure(table).axes
    dots = {
        line.get_markerfacecolor() == "white": list(
            zip(line.get_xdata(), line.get_ydata(), strict=True)
        )
        for line in axes.get_lines()
        if line.get_marker() == "o"
    }
    assert dots == {False: [(0.5, 0), (1.5, 1), (1.6, 1)], True: [(0.9, 0)]}
    assert [text.get_text() for text in axes.texts[:2]] == ["one", "other"]


def test_every_change_is_another_trial_and_its_figure_has_it():
    sizes = STUDY.preset.novice_minutes("system2")
    base = {t.key for t in STUDY.points("system2", ["sidm"], sizes)}
    changes = list(h.changes(STUDY, "system2"))
    points = [(c, t.novice_minutes, t.seed) for c, trials in changes for t in trials]
    assert len(set(points)) == len(points) and len(changes) > 20
    known = {trial.key for trial in figure(STUDY.preset, "all", "system2")}
    for change, trials in changes:
        own = {trial.key for trial in trials}
        assert own and not base & own and own <= known, change


def test_parts_of_the_experts_are_held_against_the_novices_own():
    losses = {
        "validation_loss": 2.0,
        "expert_encoder_loss": 1.0,
        "expert_decoder_loss": 4.0,
        "expert_path_loss": 2.0,
    }
    point = {"system": "system2", "novice_minutes": 20.0}
    models = pd.DataFrame([losses | point | {"seed": seed} for seed in range(3)])
    ratios = crossings(models).set_index("change").ratio.to_dict()
    expected = zip([*CROSSED.values()][1:], (0.5, 2.0, 1.0), strict=True)
    assert ratios == pytest.approx(dict(expected))


@pytest.mark.parametrize(("stopped", "training"), [(True, 4.0), (False, 2.0)])
def test_the_training_loss_is_that_near_the_kept_weights(make_row, stopped, training):
    """These are the weights before the patience, or of the lowest smoothed loss."""
    curve = dict(
        curve_samples=(1, 2, 3, 4, 5, 6),
        curve_test_loss=(3.0, 1.0, 2.0, 1.2, 1.2, 3.0),
        curve_training_loss=(9.0, 5.0, 4.0, 3.0, 2.0, 1.0),
    )
    rows = []
    for trial in STUDY.points("system1", ["novice_only", "sidm"], [5]):
        settings, row = trial.training, make_row(trial, 3.0)
        samples = 3 + settings.patience if stopped else settings.max_samples
        outcome = dataclasses.replace(row.outcome, samples=samples, **curve)
        rows.append(dataclasses.replace(row, outcome=outcome))
    table = h.memorised(frame_of(rows))
    assert list(table.method) == ["sidm", "novice_only"]
    assert set(table.training) == {training} and set(table.ratio) == {3 / training}


@pytest.fixture(scope="module")
def every():
    """All trials of the claim about the corrected model."""
    return [t for pair in claim.PAIRS for t in claim.trials(Study("study"), pair)]


@pytest.fixture
def table_of(make_row):
    """Function for the claim's table if data of a method count `power` times.

    The seed makes a little difference; the method's losses are `uneven`, too.
    """

    def table_of(trials, uneven=0.0, **power):
        rows = []
        for t in trials:
            data = power.get(t.method, 1.0) * t.novice_minutes
            loss = (1 + 0.01 * (t.seed % 100)) * data**-0.5
            if t.method == claim.METHOD:
                loss *= 1 + uneven * (-1) ** t.seed
            rows.append(make_row(t, loss))
        return claim.table(frame_of(rows))

    return table_of


def test_rivals_have_twice_the_data_and_nothing_was_chosen_by_any_of_it(every):
    own, rivals = ({}, {})
    for trial in every:
        sizes = own if trial.method == claim.METHOD else rivals
        sizes[trial.novice_minutes] = trial.method
    assert {*own} == {*claim.SIZES} and {*rivals} == {2 * m for m in claim.SIZES}
    assert {(t.motion, t.seed) for t in every} == {
        ("claim", n) for n in range(100, 105)
    }
    kinds = "novice", "validation", "rollout"
    seeds = {t.datasets[kind].collection.seed for t in every for kind in kinds}
    assert seeds == {20, 21, 23}


def test_the_claim_holds_where_the_best_rival_with_twice_the_data_is_worse(
    every, table_of
):
    """The best rival is as good as 1.4 times its data, so that 2.8 times are needed."""
    rows = table_of(every, corrected_averaged=3.0, pretrain_finetune=1.4)
    assert len(rows) == len(claim.PAIRS) * len(claim.SIZES) and rows.holds.all()
    assert set(rows.rival) == {"pretrain_finetune"}
    assert rows.ratio.tolist() == pytest.approx([(2.8 / 3) ** 0.5] * len(rows))
    rows = table_of(every, corrected_averaged=2.7, pretrain_finetune=1.4)
    assert not rows.holds.any()
    rows = table_of(every, 0.5, corrected_averaged=6.0)
    assert not rows.holds.any() and (rows.ratio < 1).all()


def test_a_missing_rival_could_have_been_the_best(every, table_of):
    without = [t for t in every if t.method != claim.RIVALS[-1]]
    assert not len(table_of(without, corrected_averaged=9.0))
