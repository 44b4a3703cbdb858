"""What a choice is worth, on made-up losses."""

import dataclasses

import pytest

from sidm.experiments import Results, Study
from sidm.experiments.choices import worth, worth_of_weights
from sidm.experiments.methods import CHOICES, COMPARED, PYTORCH_WEIGHTS
from sidm.systems import SYSTEMS


def test_a_choice_is_compared_seed_by_seed(tmp_path, make_row):
    """Twice the loss with PyTorch's weights; what is not stored on both sides has no line."""
    study, store = Study("laptop", tmp_path, tmp_path), Results(tmp_path)
    changed = study.changed(initialisation="pytorch")
    for one, factor in ((study, 1.0), (changed, 2.0)):
        for trial in one.points("system1", ["sidm"], [5.0]):
            store.put(make_row(trial, factor * (1 + trial.seed)))
    (line,) = worth(study, ["system1", "system2"], store)
    assert (line.choice, line.method, line.minutes, line.seeds) == (PYTORCH_WEIGHTS, "sidm", 5, 3)
    assert (line.chosen, line.changed) == (2, 4) and line.ratio == pytest.approx((2, 2, 2))
    assert worth_of_weights(study, ["system1", "system2"], store) == [line]


def test_every_choice_changes_the_trials_it_names():
    """One thing at a time, from the trials of Figure 3."""
    study = Study("laptop")
    base = {trial.key for trial in study.figure3("system1")}
    trials = study.choices("system1")
    assert len(trials) == 3 * sum(len(methods) for _, methods in CHOICES.values())
    assert not base & {trial.key for trial in trials} and len({trial.key for trial in trials}) == len(trials)


def test_initial_weights_are_changed_at_every_size():
    """The paper's methods of Figure 3, and nothing but their initial weights."""
    study = Study("laptop")
    for system in SYSTEMS:
        trials = study.initial_weights(system)
        ours = [trial for trial in study.figure3(system) if trial.method in COMPARED]
        assert {trial.network.initialisation for trial in trials} == {"pytorch"}
        scaled = [dataclasses.replace(trial.network, initialisation="scaled") for trial in trials]
        assert [t.replace(network=n) for t, n in zip(trials, scaled, strict=True)] == ours
