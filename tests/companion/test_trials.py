"""Trials, presets and grids."""

import dataclasses
import json
from collections import Counter
from pathlib import Path
from typing import get_args, get_type_hints

import pytest
import yaml

from companion import METHODS, PRESETS, Study, Trial, grid, load_preset
from companion.methods import COMPARED, CORES, MIRRORED, RIVAL, VARIANTS
from companion.presets import POLICIES
from companion.studies import ablations, baselines, choices, duration, tuning, variants
from sidm.body import ROVER
from sidm.config import ConfigError, from_mapping, replace
from sidm.systems import SYSTEMS

TRIAL = Trial(
    system="system1",
    method="sidm",
    novice_minutes=1,
    seed=0,
    pool_minutes=2,
    expert_minutes=3,
    validation_minutes=1,
    rollouts=4,
)
OTHER = {
    "system": "system2",
    "method": "novice_only",
    "novice_minutes": 2,
    "seed": 1,
    "pool_minutes": 3,
    "expert_minutes": 4,
    "validation_minutes": 2,
    "rollouts": 5,
    "policy": "sinusoid",
}


def changed(value, kind):
    """Another value of the same type."""
    if value is None:
        return ROVER  # another body
    if isinstance(value, bool):
        return not value
    if isinstance(value, str):
        return next(choice for choice in get_args(kind) if choice != value)
    if isinstance(value, tuple):
        return tuple(item + 1 for item in value)
    return value + 1 if isinstance(value, int) else value / 2 or 0.5


def test_key_survives_json():
    """A trial read from JSON is equal and has the same key.

    Ints may stand for floats.
    """
    back = from_mapping(Trial, json.loads(json.dumps(TRIAL.to_json())))
    assert back == TRIAL
    assert back.key == TRIAL.key == TRIAL.replace(novice_minutes=1.0).key
    assert len(TRIAL.key) == 20


def test_key_feels_every_field():
    """Trials that differ in one value, also of network or training, have other keys."""
    variants = [TRIAL] + [
        TRIAL.replace(**{name: value}) for name, value in OTHER.items()
    ]
    for part in ("network", "training"):
        settings = getattr(TRIAL, part)
        own = {
            field.name: getattr(settings, field.name)
            for field in dataclasses.fields(settings)
        }
        for name, kind in get_type_hints(type(settings)).items():
            other = type(settings)(**(own | {name: changed(own[name], kind)}))
            variants.append(TRIAL.replace(**{part: other}))
    names = {field.name for field in dataclasses.fields(TRIAL)}
    without = {
        "training": dataclasses.replace(TRIAL.training, p_expert=0.0, regularise=False)
    }
    for residual in (False, True):
        variants.append(
            TRIAL.replace(**without, pretraining=without["training"], residual=residual)
        )
    variants += [
        variants[-2].replace(pretraining=None, fit="least_squares"),
        variants[-1].replace(fit="least_squares"),
    ]
    variants.append(TRIAL.replace(motion="tuning"))
    core = TRIAL.replace(**without, pretraining=without["training"])
    variants.append(core.replace(pretrained="sidm"))
    assert names == {
        *OTHER,
        "network",
        "training",
        "pretraining",
        "residual",
        "fit",
        "motion",
        "pretrained",
    }
    assert len({trial.key for trial in variants}) == len(variants)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"novice_minutes": 5},
            r"novice_minutes must be above 0 and at most pool_minutes \(2\), not 5",
        ),
        ({"system": "system3"}, "unknown system 'system3'"),
        ({"rollouts": 0}, "rollouts must be at least 1, not 0"),
        ({"sede": 1}, "did you mean 'seed'"),
        ({"pretrained": "sidm"}, "goes with a pretraining, and not with residual"),
        (
            {"fit": "least_squares"},
            "least_squares' stands alone, or is the residual of a pretraining",
        ),
    ],
)
def test_trials_refuse_what_cannot_be_run(changes, words):
    """The error says in one line which value is wrong."""
    with pytest.raises(ConfigError, match=words):
        from_mapping(Trial, TRIAL.to_json() | changes)


def test_what_came_later_is_not_named_by_default():
    """Keys of results that were stored before a field existed still hold."""
    assert TRIAL.replace(motion="tuning").to_json()["motion"] == "tuning"
    assert "motion" not in TRIAL.to_json()
    alone = replace(TRIAL.training, p_expert=0.0, regularise=False)
    solved = TRIAL.replace(training=alone, fit="least_squares")
    assert "fit" not in TRIAL.to_json() and solved.to_json()["fit"] == "least_squares"
    assert from_mapping(Trial, solved.to_json()) == solved


def test_datasets_are_disjoint():
    """Pool, validation, expert and rollouts come from four collections."""
    sets = TRIAL.datasets
    assert len({dataset.collection for dataset in sets.values()}) == 4
    assert sets["novice"].name == "system1/novice/ornstein_uhlenbeck/seed-0/19"
    assert sets["rollout"].collection.policy == "held" and sets["rollout"].count == 4
    assert sets["expert"].collection.role == "expert"
    assert sets["expert"].collection.seed == 2


def test_presets_are_the_papers():
    """The paper's Figure 3 has 320 trials.

    The sizes of `laptop` are those of the table of presets.
    """
    for name in ("paper", "released"):
        assert sum(trial.method in COMPARED for trial in grid(name)) == 320
    assert len(grid("laptop")) == 2 * 6 * 3 * 3  # systems, sizes, methods, seeds
    paper = load_preset("paper").network
    assert (paper.pixels, paper.layers, paper.hidden) == (300, 4, 1024)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"pixel": 64}, "unknown name 'pixel' in a preset; did you mean 'pixels'"),
        (
            {"regularise": False},
            "unknown name 'regularise'",
        ),  # which the methods set
        ({"seeds": "many"}, "'Preset.seeds' must be int"),
        ({"seeds": 0}, "seeds must be from 1 to 1000, not 0"),
        (
            {"novice_minutes_system1": [1, 600]},
            "novice_minutes_system1 asks for 600, but pool_minutes_system1 is 120",
        ),
        ({"policy": "orstein"}, "did you mean 'ornstein_uhlenbeck'"),
        ({"expert_minutes": -5}, "expert_minutes must be positive"),
        ({"validation_minutes": float("nan")}, "validation_minutes"),
        ({"ablation_minutes": [0.0]}, "ablation_minutes must be positive"),
        ({"p_expert_system2": 2}, "p_expert_system2 must be from 0 to 1"),
        ({"weight_decay": 1e999}, "weight_decay"),
        ({"tuned": [["sidm", "weight_decai", 0.1]]}, "did you mean 'weight_decay'"),
    ],
)
def test_presets_refuse_what_no_preset_can_have(changes, words):
    """The error is one line and suggests the nearest right name."""
    with pytest.raises(ConfigError, match=words):
        load_preset("laptop", **changes)


def test_presets_are_known_by_name():
    with pytest.raises(ConfigError, match="did you mean 'laptop'"):
        load_preset("lapto")


def test_preset_changes_reach_network_and_training():
    """Names of a preset lead to its parts, which have no name in common."""
    changed = load_preset(
        "laptop", pixels=64, max_samples=1000, seeds=5, p_expert_system2=0.25
    )
    assert (changed.network.pixels, changed.training.max_samples, changed.seeds) == (
        64,
        1000,
        5,
    )
    assert changed.training_of(METHODS["sidm"], "system2").p_expert == 0.25
    names = [
        f.name
        for part in (changed, changed.network, changed.training)
        for f in dataclasses.fields(part)
    ]
    assert len(names) == len(set(names))


def test_methods_differ_only_in_their_training():
    """Training alone is the same loop without expert data and adversary (section 4)."""
    for system, p in (("system1", 0.75), ("system2", 0.5)):
        with_sidm, without = (
            Study("laptop").trial(system, m, 5) for m in ("sidm", "novice_only")
        )
        assert (with_sidm.training.p_expert, with_sidm.training.regularise) == (p, True)
        assert (without.training.p_expert, without.training.regularise) == (0.0, False)
        assert without.replace(method="sidm", training=with_sidm.training) == with_sidm


def test_grids():
    """Seeds pair the methods, and ablations share trials with Figure 3.

    Filters name what the grid has.
    """
    study = Study("laptop")
    points = {
        (t.novice_minutes, t.seed)
        for t in study.figure3("system1")
        if t.method == "sidm"
    }
    assert points == {
        (t.novice_minutes, t.seed)
        for t in study.figure3("system1")
        if t.method == "novice_only"
    }
    figure3 = {t.key for t in study.figure3("system1")}
    assert len(study.figure4()) == 2 * 3 * 10
    assert len({t.key for t in study.figure4()} & figure3) == 2 * 3 * 3
    # p_e of 0.75, three seeds
    assert len({t.key for t in ablations.p_expert(study, "system1")} & figure3) == 3
    # 100, 20 and 5 iterations
    assert len({t.key for t in ablations.phases(study, "system1")} & figure3) == 3
    for name in (ablations.pixels, ablations.patience):
        # both methods
        assert len({t.key for t in name(study, "system1")} & figure3) == 2 * 3
    neighbours = baselines.trials(study, "system1")
    # three methods, two sizes, and all data
    assert len({t.key for t in neighbours} & figure3) == 3 * 2 * 3 + 3
    assert {t.method for t in neighbours} == set(METHODS) - {
        *VARIANTS,
        *MIRRORED,
        *CORES,
        RIVAL,
    }
    listed = variants.trials(study, "system1")
    # two at 20, 60, 120, too
    assert len(listed) == len({t.key for t in listed}) == 15 * 4 * 3 + 2 * 3 * 3
    assert {t.key for t in variants.correction(study, "system1")} < {
        t.key for t in listed
    }
    assert len(grid("laptop", "3", "system2", minutes=[5, 20], seeds=[1])) == 2 * 3
    assert {t.key for t in grid("laptop", "all")} >= figure3
    with pytest.raises(
        ConfigError, match="minutes 3 is not in this grid; it has 1, 2, 5, 20, 60, 120"
    ):
        grid("laptop", minutes=[3])
    with pytest.raises(ConfigError, match="figure 4 has no trials of system2"):
        grid("laptop", "4", "system2")
    with pytest.raises(
        ConfigError, match="figure 'yardsticks' is called 'references' now"
    ):
        grid("laptop", "yardsticks")
    with pytest.raises(ConfigError, match="did you mean 'p-expert'"):
        grid("laptop", "p_expert")
    with pytest.raises(ConfigError, match="did you mean 'novice_only'"):
        study.trial("system1", "novice-only", 5)


def test_the_study_has_grids_of_its_own():
    """Little data have more seeds.

    Settings are chosen on motion that no figure uses.
    """
    study = Study("study")
    seeds = Counter(
        t.novice_minutes for t in study.figure3("system2") if t.method == "sidm"
    )
    assert seeds == {1: 10, 2: 5, 5: 10, 20: 5, 60: 5, 120: 5}
    figures, laptop = (
        {t.key: t for t in Study(name).figure3("system1")}
        for name in ("study", "laptop")
    )
    assert laptop.keys() < figures.keys()
    tried, long = tuning.trials(study, "system1"), duration.trials(study, "system1")
    assert {t.datasets["expert"] for t in tried} == {
        t.datasets["expert"] for t in figures.values()
    }
    novices = [
        {
            t.datasets[kind]
            for t in trials
            for kind in ("novice", "validation", "rollout")
        }
        for trials in (figures.values(), tried, long)
    ]
    assert len(novices[0]) == 3 and not novices[0] & (novices[1] | novices[2])
    every = {d for t in [*figures.values(), *tried] for d in t.datasets.values()}
    assert set(study.preset.all_datasets("system1")) == every
    assert {t.training.batch for t in long} == {8}
    assert all(t.training.patience == 2_500_000 for t in long)
    chosen_by = [*tried, *long]
    assert {t.key for t in chosen_by} < {t.key for t in grid("study", "all", "system1")}
    assert not {t.key for t in choices.trials(study, "system1")} & {
        t.key for t in grid("study", "all")
    }


def test_parameter_files_name_their_preset():
    """params/NAME.yaml requests the preset NAME for the notebooks.

    Only the smoke preset runs missing trials by itself.
    """
    folder = Path(__file__).parents[2] / "params"
    found = {
        path.stem: yaml.safe_load(path.read_text()) for path in folder.glob("*.yaml")
    }
    assert found.keys() == PRESETS.keys()
    for name, values in found.items():
        assert values["preset"] == name and values["run_missing"] == (name == "smoke")


def test_a_system_of_your_own_has_system_1s_sizes(monkeypatch):
    """A third system can be listed, run and shown beside the paper's two."""
    system = dataclasses.replace(SYSTEMS["system1"], name="soft")
    monkeypatch.setitem(SYSTEMS, "soft", system)
    preset = load_preset("smoke")
    assert preset.pool_minutes("soft") == preset.pool_minutes_system1
    assert {trial.system for trial in Study(preset).figure3("soft")} == {"soft"}
    assert (
        Study(preset).trial("soft", "sidm", 0.5).training.p_expert
        == preset.p_expert_system1
    )


def test_the_policies_of_a_preset_are_those_of_the_simulation():
    from sidm.simulation import POLICIES as simulated

    assert set(POLICIES) == set(simulated)
