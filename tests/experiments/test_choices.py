"""What a choice is worth, on made-up losses."""

import pytest

from sidm.experiments import Results, Study
from sidm.experiments.choices import worth
from sidm.experiments.methods import CHOICES


def test_a_choice_is_compared_seed_by_seed(tmp_path, make_row):
    """Twice the loss with PyTorch's weights; what is not stored on both sides has no line."""
    study, store = Study("laptop", tmp_path, tmp_path), Results(tmp_path)
    changed = study.changed(initialisation="pytorch")
    for one, factor in ((study, 1.0), (changed, 2.0)):
        for trial in one.points("system1", ["sidm"], [5.0]):
            store.put(make_row(trial, factor * (1 + trial.seed)))
    (line,) = worth(study, ["system1", "system2"], store)
    assert (line.choice, line.method, line.seeds) == ("PyTorch's initial weights", "sidm", 3)
    assert (line.chosen, line.changed) == (2, 4) and line.ratio == pytest.approx((2, 2, 2))


def test_every_choice_changes_the_trials_it_names():
    """One thing at a time, from the trials of Figure 3."""
    study = Study("laptop")
    base = {trial.key for trial in study.figure3("system1")}
    trials = study.choices("system1")
    assert len(trials) == 3 * sum(len(methods) for _, methods in CHOICES.values())
    assert not base & {trial.key for trial in trials} and len({trial.key for trial in trials}) == len(trials)
