"""The effect of a single choice, on made-up losses."""

import pytest

from companion import Results, Study
from companion.methods import (
    ALL_RELEASED,
    BOTH_OF_SIDM,
    CHOICES,
    COMPARED,
    LONG_PATIENCE,
    PYTORCH_WEIGHTS,
    RELEASED,
)
from companion.studies import choices
from sidm.config import replace
from sidm.systems import SYSTEMS


def test_a_choice_is_compared_seed_by_seed(tmp_path, make_row):
    """The loss doubles with PyTorch's weights.

    Choices that are not stored on both sides have no line.
    """
    study, store = Study("laptop", tmp_path, tmp_path), Results(tmp_path)
    changed = study.changed(initialisation="pytorch")
    for one, factor in ((study, 1.0), (changed, 2.0)):
        for trial in one.points("system1", ["sidm"], [5.0]):
            store.put(make_row(trial, factor * (1 + trial.seed)))
    (line,) = choices.table(
        choices.frame(study, store, ["system1", "system2"]), tmp_path
    ).itertuples()
    expected = (PYTORCH_WEIGHTS, "sidm", 5, 3)
    assert (line.choice, line.method, line.novice_minutes, line.seeds) == expected
    assert (line.reference, line.mean) == (2, 4)
    assert (line.ratio, line.low, line.high) == pytest.approx((2, 2, 2))


def test_every_choice_changes_the_trials_it_names():
    """Each choice changes one setting of the trials of Figure 3."""
    study = Study("laptop")
    base = {trial.key for trial in study.figure3("system1")}
    trials = choices.trials(study, "system1")
    assert len(trials) == 3 * sum(len(methods) for _, methods in CHOICES.values())
    assert not base & {trial.key for trial in trials}
    assert len({trial.key for trial in trials}) == len(trials)


def test_choices_made_together_are_compared_at_every_size(tmp_path, make_row):
    """The table has a line for each size that both sides have."""
    study, store = Study("laptop", tmp_path, tmp_path), Results(tmp_path)
    changes, _ = RELEASED[BOTH_OF_SIDM]
    for minutes in (1.0, 20.0):
        for one, factor in ((study, 1.0), (study.changed(**changes), minutes)):
            for trial in one.points("system2", ["sidm"], [minutes]):
                store.put(make_row(trial, factor * (1 + trial.seed)))
    both = choices.frame(study, store, SYSTEMS, RELEASED)
    lines = choices.table(both, tmp_path).itertuples()
    assert [
        (line.system, line.choice, line.novice_minutes, line.ratio) for line in lines
    ] == [
        ("system2", BOTH_OF_SIDM, 1, pytest.approx(1)),
        ("system2", BOTH_OF_SIDM, 20, pytest.approx(20)),
    ]


def test_released_choices_are_made_together_at_every_size():
    """All choices but the patience change both of the paper's methods.

    Two of the choices concern SIDM alone; nothing else changes.
    """
    study = Study("laptop")
    settings = {
        setting
        for words, (changes, _) in CHOICES.items()
        if words != LONG_PATIENCE
        for setting in changes
    }
    assert RELEASED[ALL_RELEASED][0].keys() == settings
    for system in SYSTEMS:
        sizes = study.preset.novice_minutes(system)
        trials = choices.changed(study, system, RELEASED)
        every, two = (trials[words] for words in (ALL_RELEASED, BOTH_OF_SIDM))
        assert choices.released(study, system) == [*two, *every]
        assert {(t.method, t.novice_minutes) for t in every} == {
            (method, m) for method in COMPARED for m in sizes
        }
        assert {(t.method, t.novice_minutes) for t in two} == {
            ("sidm", m) for m in sizes
        }
        assert {t.network.initialisation for t in every} == {"pytorch"}
        ours = [t.training for t in study.figure3(system) if t.method == "sidm"]
        plain = dict(system_draw="trajectory", matching_optimiser="own")
        assert [replace(t.training, **plain) for t in two] == ours
        mine = [t.training for t in every if t.method == "sidm"]
        assert [
            replace(t, **plain, reduction="sum", decay="decoupled") for t in mine
        ] == ours
