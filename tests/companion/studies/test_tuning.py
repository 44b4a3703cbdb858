"""Searches of settings: what was tried, and that the methods follow from it."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from companion import Results, Study, load_preset
from companion.engine.frame import frame_of
from companion.methods import FOR_LITTLE, METHODS
from companion.numerics import versions
from companion.registry import MEASUREMENTS
from companion.statistics.savings import savings
from companion.studies import tree_search
from companion.studies.tree_search import draw
from companion.studies.tuning import (
    LITTLE,
    LITTLE_TRIES,
    LITTLE_WORTH,
    TRIES,
    TUNING_SEED,
    best_novice_only,
    frame,
    little_data,
    little_data_results,
    settings,
    table,
    untuned,
)
from companion.studies.tuning import trials as trials_of
from ownrobot.methods import boosting
from ownrobot.methods.boosting import Growth
from sidm.storage import read_record, write_record
from sidm.systems import PAPER_SYSTEMS
from tests.companion.conftest import RESULTS

STORED = Results(RESULTS)


def test_every_method_has_as_many_tries_and_the_lowest_test_loss_is_marked(
    tiny, make_row, tmp_path
):
    # so that the method uses the untuned base
    preset = tiny.replace(tuning_minutes=[0.5], test_interval=25)
    study, store = Study(preset), Results(tmp_path)
    trials = trials_of(study, "system1")
    assert len({trial.key for trial in trials}) == len(trials) == 3 * 7
    assert {trial.seed for trial in trials} == {TUNING_SEED}
    assert not len(table(frame(study, store, ["system1"])))
    for number, trial in enumerate(trials):
        row = make_row(trial, 100 - number)  # the validation loss must not matter
        lost = 1.0 + abs(number - 3.5)  # a tie of 3 and 4
        outcome = dataclasses.replace(row.outcome, best_test_loss=lost)
        store.put(dataclasses.replace(row, outcome=outcome))
    rows = table(frame(study, store, ["system1"]))
    assert rows.lowest[:7].tolist() == [number == 3 for number in range(7)]
    assert rows.lowest.sum() == 3
    assert rows["try"].tolist() == [w for tries in TRIES.values() for w in tries]
    assert rows["try"][rows.used].tolist() == [next(iter(t)) for t in TRIES.values()]
    assert rows["try"][6] == "weight decay 0.1"
    assert trials[6].training.weight_decay == 0.1


@pytest.mark.parametrize("method", TRIES)
def test_the_laptop_is_tuned_to_its_best_tries(method):
    """By the rule, the lowest test loss on system 1 wins."""
    preset = load_preset("laptop")
    trials = trials_of(Study("laptop"), "system1")
    trials = [trial for trial in trials if trial.method == method]
    losses = [row.outcome.best_test_loss for row in STORED.stored(trials)]
    assert len(losses) == len(TRIES[method])
    chosen = list(TRIES[method])[losses.index(min(losses))]
    one, tried = METHODS[method], untuned(preset, TRIES[method][chosen])
    assert preset.training_of(one, "system1") == tried.training_of(one, "system1")
    assert not one.pretrained or preset.pretraining_of(one) == tried.pretraining_of(one)


@pytest.mark.parametrize("system", PAPER_SYSTEMS)
@pytest.mark.parametrize("method", LITTLE_TRIES)
def test_with_little_data_the_best_tries_at_five_minutes_are_taken(method, system):
    """A system's lowest test loss wins, unless Figure 3's setting is about as good."""
    study = Study("study")
    trials = [t for t in trials_of(study, system) if t.method == method]
    losses = [row.outcome.best_test_loss for row in STORED.stored(trials)]
    assert len(losses) == len(LITTLE_TRIES[method]) == 6
    ways = [(trial.training, trial.pretraining) for trial in trials]
    figure3 = study.points(system, [method], [5.0])[0]
    same = losses[ways.index((figure3.training, figure3.pretraining))]
    repeated = [t for t in little_data(study, system) if t.method == method]
    worth = same / min(losses) - 1 > LITTLE_WORTH
    assert (method in LITTLE[system]) == bool(repeated) == worth
    chosen = ways[losses.index(min(losses))]
    assert {(t.training, t.pretraining) for t in repeated} <= {chosen}
    assert {t.motion for t in repeated} <= {"figures"}


def test_savings_are_beside_the_best_of_training_alone(make_row, tmp_path):
    """The SIDM's data count eight times.

    On system 2, with its own settings, the data of training alone count twice.
    """
    study, store = Study("study"), Results(tmp_path)

    def row(trial, worth=1.0):
        loss = (worth * trial.novice_minutes) ** -0.5
        return make_row(trial, (1 + 0.01 * trial.seed) * loss)

    figure3 = frame_of(row(t) for s in PAPER_SYSTEMS for t in study.figure3(s))
    worth = {"sidm": 8.0, "novice_only": 2.0}
    for trial in (t for s in PAPER_SYSTEMS for t in little_data(study, s)):
        store.put(row(trial, worth[trial.method]))
    little = little_data_results(study, store, PAPER_SYSTEMS)
    both = pd.concat([little, best_novice_only(figure3, little)])
    rows = savings(both, ["sidm" + FOR_LITTLE])
    assert rows.drop_duplicates("system").ratio.tolist() == pytest.approx([8, 4])


def test_the_settings_that_each_method_came_to():
    rows = settings(load_preset("laptop"))
    assert rows.novice_only.weight_decay == "0.1"
    assert rows.novice_only.matching_iterations == rows.novice_only.p_expert == "-"
    assert rows.sidm.p_expert == "0.75 (system 1), 0.5 (system 2)"
    assert rows.pretrain_finetune.learning_rate == "0.001, then 0.0001"


@pytest.fixture
def few(study, monkeypatch):
    """A search of trees, of two draws a method on the tiny study's motion."""

    def trial(study, seed):
        return study.trial("system1", "least_squares", 0.75, seed)

    monkeypatch.setattr(tree_search, "_trial", trial)
    monkeypatch.setattr(tree_search, "DRAWS", {"trees": 2, "trees_corrected": 2})
    monkeypatch.setattr(tree_search, "SEEDS", (0, 1))
    monkeypatch.setattr(tree_search, "ROUNDS", 50)
    monkeypatch.setattr(tree_search, "LEAVES", (3,))
    monkeypatch.setattr(tree_search, "BEFORE", (Growth(50, leaves=3),) * 2)
    return study


def test_a_search_of_trees_goes_on_where_it_was(few, data, tmp_path):
    """A draw that is kept is not searched again."""
    kept = data / "checkpoints" / tree_search.NAME
    done = {"trees 0": [1.0, 2.0]}
    write_record(kept, {"losses": done, "numerics": versions("fitting")})
    MEASUREMENTS["tree-search"].run(few, None, 1, data, tmp_path)
    stored = read_record(tmp_path / tree_search.NAME)
    assert stored["numerics"] == versions("fitting") and not kept.exists()
    assert stored["trees"][0][1] == [1.0, 2.0] != stored["trees"][1][1]
    assert [Growth(*values) for values in stored["trees"][1][0]] == draw("trees", 1)


def test_trees_grow_with_what_the_search_chose():
    """The draw of each method whose losses by least squares are the lowest."""
    stored, best = read_record(RESULTS / tree_search.NAME), {}
    for method in tree_search.DRAWS:
        losses = np.array([found for _, found in stored[method]])
        scores = np.log(losses / stored["least_squares"]).mean(1)
        best[method] = draw(method, int(scores.argmin()))
    assert [boosting.NOVICE] == best["trees"]
    assert [boosting.CORRECTION, boosting.EXPERT] == best["trees_corrected"]
