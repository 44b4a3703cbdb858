"""Tries of the tuning: the methods of `laptop` follow from the stored tries."""

import dataclasses

import pandas as pd
import pytest

from companion import Results, Study, load_preset
from companion.engine.frame import frame_of
from companion.methods import FOR_LITTLE, METHODS
from companion.statistics.savings import savings
from companion.studies.tuning import (
    LITTLE,
    LITTLE_TRIES,
    LITTLE_WORTH,
    TRIES,
    TUNED,
    TUNING_SEED,
    best_novice_only,
    frame,
    little_data,
    little_data_results,
    preset_of_try,
    settings,
    table,
)
from companion.studies.tuning import trials as trials_of
from sidm.systems import SYSTEMS
from tests.companion.conftest import RESULTS


def test_every_method_is_tuned_with_the_same_number_of_tries(tiny, tmp_path):
    """Tries use a seed that no figure has.

    The expert's part of a method takes the tries' values.
    """
    trials = trials_of(
        Study(tiny.replace(tuning_minutes=[0.5]), tmp_path, tmp_path), "system1"
    )
    assert len({len(tries) for tries in TRIES.values()}) == 1
    assert {t.seed for t in trials} == {TUNING_SEED}
    assert [t.method for t in trials] == [
        method for method, tries in TRIES.items() for _ in tries
    ]
    assert all(
        (t.pretraining is None) == (not METHODS[t.method].pretrained) for t in trials
    )
    assert len({t.key for t in trials}) == len(trials)


def test_the_lowest_test_loss_is_marked(tiny, make_row, tmp_path):
    # so that the method uses the untuned base
    preset = tiny.replace(tuning_minutes=[0.5], test_interval=25)
    study, store = Study(preset, tmp_path, tmp_path), Results(tmp_path)
    trials = trials_of(study, "system1")
    for number, trial in enumerate(trials):
        row = make_row(trial, 100 - number)  # the validation loss must not matter
        # a tie of 3 and 4
        outcome = dataclasses.replace(
            row.outcome, best_test_loss=1.0 + abs(number - 3.5)
        )
        store.put(dataclasses.replace(row, outcome=outcome))
    rows = table(frame(study, store, ["system1"]))
    assert rows.lowest[:7].tolist() == [number == 3 for number in range(7)]
    assert rows.lowest.sum() == 3
    assert rows["try"][rows.used].tolist() == [
        next(iter(tries)) for tries in TRIES.values()
    ]
    assert rows["try"].tolist() == [
        words for tries in TRIES.values() for words in tries
    ]
    assert rows["try"][6] == "weight decay 0.1"
    assert trials[6].training.weight_decay == 0.1
    assert not len(table(frame(study, Results(tmp_path / "nothing"), ["system1"])))


def test_the_study_has_tries_of_its_own_on_motion_of_their_own(tmp_path):
    """Methods have equally many tries; SIDM tunes p_e; no method was tuned before."""
    trials = trials_of(Study("study", tmp_path, tmp_path), "system2")
    counts = {len(its) for its in LITTLE_TRIES.values()}
    assert len(trials) == 3 * counts.pop()
    assert not counts
    assert len({t.key for t in trials}) == len(trials)
    assert {t.motion for t in trials} == {"tuning"}
    assert {t.novice_minutes for t in trials} == {5}
    assert {t.training.p_expert for t in trials if t.method == "sidm"} == {0.5, 0.9}
    assert {t.training.matching_iterations for t in trials if t.method == "sidm"} == {
        5,
        20,
        100,
    }


@pytest.mark.parametrize("method", TRIES)
def test_the_laptop_is_tuned_to_its_best_tries(method):
    """By the rule, the lowest test loss on system 1 wins."""
    preset, store = load_preset("laptop"), Results(RESULTS)
    trials = [
        t
        for t in trials_of(Study("laptop", "no data", RESULTS), "system1")
        if t.method == method
    ]
    losses = [row.outcome.best_test_loss for row in store.rows(trials)]
    assert len(losses) == len(TRIES[method])
    best = preset_of_try(preset, method, list(TRIES[method])[losses.index(min(losses))])
    assert preset.training_of(METHODS[method], "system1") == best.training_of(
        METHODS[method], "system1"
    )
    if METHODS[method].pretrained:
        assert preset.pretraining_of(METHODS[method]) == best.pretraining_of(
            METHODS[method]
        )


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("method", LITTLE_TRIES)
def test_with_little_data_the_best_tries_at_five_minutes_are_taken(method, system):
    """A system's lowest test loss wins, unless Figure 3's setting is about as good."""
    study, store = Study("study", "no data", RESULTS), Results(RESULTS)
    trials = [t for t in trials_of(study, system) if t.method == method]
    losses = [row.outcome.best_test_loss for row in store.rows(trials)]
    assert len(losses) == len(LITTLE_TRIES[method])
    best = trials[losses.index(min(losses))]
    figure3 = study.points(system, [method], [5.0])[0]
    same = [
        t
        for t in trials
        if (t.training, t.pretraining) == (figure3.training, figure3.pretraining)
    ]
    (above,) = (losses[trials.index(t)] / min(losses) - 1 for t in same)
    repeated = [t for t in little_data(study, system) if t.method == method]
    assert (method in LITTLE[system]) == bool(repeated) == (above > LITTLE_WORTH)
    if repeated:
        assert len({t.key for t in repeated}) == 15
        assert {t.seed for t in repeated} == set(range(5))
        assert {(t.training, t.pretraining) for t in repeated} == {
            (best.training, best.pretraining)
        }
        assert {t.motion for t in repeated} == {"figures"}


def test_savings_are_beside_the_best_of_training_alone(make_row, tmp_path):
    """The SIDM's data count eight times.

    On system 2, with its own settings, the data of training alone count twice.
    """
    study, store = Study("study", tmp_path, tmp_path), Results(tmp_path)

    def row(trial, worth=1.0):
        return make_row(
            trial, (1 + 0.01 * trial.seed) * (worth * trial.novice_minutes) ** -0.5
        )

    figure3 = frame_of(row(t) for s in SYSTEMS for t in study.figure3(s))
    worth = {"sidm": 8.0, "novice_only": 2.0}
    for trial in (t for s in SYSTEMS for t in little_data(study, s)):
        store.put(row(trial, worth[trial.method]))
    little = little_data_results(study, store, SYSTEMS)
    rows = savings(
        pd.concat([little, best_novice_only(figure3, little)]), ["sidm" + FOR_LITTLE]
    )
    assert rows.drop_duplicates("system").ratio.tolist() == pytest.approx([8, 4])


def test_the_settings_that_each_method_came_to():
    rows = settings(load_preset("laptop"))
    assert list(rows.index) == ["p_expert", *TUNED] and list(rows) == list(TRIES)
    assert rows.novice_only.weight_decay == "0.1"
    assert rows.novice_only.matching_iterations == "-"
    assert rows.sidm.matching_iterations == "5"
    assert rows.sidm.p_expert == "0.75 (system 1), 0.5 (system 2)"
    assert rows.pretrain_finetune.learning_rate == "0.001, then 0.0001"
    assert rows.novice_only.p_expert == "-"
    assert rows.pretrain_finetune.patience == "150,000"
