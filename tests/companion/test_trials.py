"""Trials, presets, grids, and what figures cost."""

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
from companion.trials import without_later
from sidm.body import ROVER
from sidm.config import ConfigError, from_mapping, replace, to_mapping
from sidm.systems import FREE_SYSTEMS, PAPER_SYSTEMS, SYSTEMS

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
ALONE = replace(TRIAL.training, p_expert=0.0, regularise=False)
PRETRAINED = TRIAL.replace(training=ALONE, pretraining=ALONE)
#: Field -> a change of it, or a trial that differs from another one in it.
CHANGES = {
    "system": "system2",
    "method": "novice_only",
    "novice_minutes": 2,
    "seed": 1,
    "pool_minutes": 3,
    "expert_minutes": 4,
    "validation_minutes": 2,
    "rollouts": 5,
    "policy": "sinusoid",
    "motion": "tuning",
}
OTHERS = {name: TRIAL.replace(**{name: value}) for name, value in CHANGES.items()} | {
    "pretraining": PRETRAINED,
    "pretrained": PRETRAINED.replace(pretrained="sidm"),
    "residual": PRETRAINED.replace(residual=True),
    "fit": TRIAL.replace(training=ALONE, fit="least_squares"),
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


@pytest.mark.parametrize("trial", [TRIAL, OTHERS["fit"], OTHERS["motion"]])
def test_a_trial_comes_back_from_json_with_its_key(trial):
    values = without_later(to_mapping(trial))
    later = {"motion", "fit", "pretrained"}  # keys of older results leave them out
    default = {name for name in later if getattr(trial, name) == getattr(TRIAL, name)}
    assert later - default == later & values.keys()
    back = from_mapping(Trial, json.loads(json.dumps(values)))
    assert back == trial
    assert back.key == trial.key == trial.replace(novice_minutes=1.0).key


def test_a_key_feels_every_field():
    trials = [TRIAL, *OTHERS.values()]
    for part in ("network", "training"):
        settings = getattr(TRIAL, part)
        for name, kind in get_type_hints(type(settings)).items():
            other = {name: changed(getattr(settings, name), kind)}
            trials.append(TRIAL.replace(**{part: replace(settings, **other)}))
    names = {field.name for field in dataclasses.fields(TRIAL)}
    assert names == {*OTHERS, "network", "training"}
    assert len({trial.key for trial in trials}) == len(trials)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"novice_minutes": 5}, r"at most pool_minutes \(2\), not 5"),
        ({"system": "system3"}, "unknown system 'system3'"),
        ({"rollouts": 0}, "rollouts must be at least 1, not 0"),
        ({"sede": 1}, "did you mean 'seed'"),
        ({"pretrained": "sidm"}, "goes with a pretraining, and not with residual"),
        ({"fit": "least_squares"}, "stands alone, or is the residual"),
    ],
)
def test_trials_refuse_what_cannot_be_run(changes, words):
    with pytest.raises(ConfigError, match=words):
        from_mapping(Trial, to_mapping(TRIAL) | changes)


def test_datasets_are_disjoint():
    sets = TRIAL.datasets
    assert len({dataset.collection for dataset in sets.values()}) == 4
    assert sets["novice"].name == "system1/novice/ornstein_uhlenbeck/seed-0/19"
    assert sets["rollout"].collection.policy == "held" and sets["rollout"].count == 4


def test_presets_are_the_papers():

    def of_paper(preset):  # a reader may have added a system
        return [trial for trial in grid(preset) if trial.system in PAPER_SYSTEMS]

    for name in ("paper", "released"):
        assert sum(trial.method in COMPARED for trial in of_paper(name)) == 320
    assert len(of_paper("laptop")) == 2 * 6 * 3 * 3  # systems, sizes, methods, seeds
    paper = load_preset("paper").network
    assert (paper.pixels, paper.layers, paper.hidden) == (300, 4, 1024)
    folder = Path(__file__).parents[2] / "params"
    found = {p.stem: yaml.safe_load(p.read_text()) for p in folder.glob("*.yaml")}
    assert found.keys() == PRESETS.keys()
    for name, values in found.items():
        assert values["preset"] == name and values["run_missing"] == (name == "smoke")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"pixel": 64}, "'pixel' in a preset; did you mean 'pixels'"),
        ({"regularise": False}, "unknown name 'regularise'"),  # which the methods set
        ({"seeds": "many"}, "'Preset.seeds' must be int"),
        ({"seeds": 0}, "seeds must be from 1 to 1000, not 0"),
        ({"novice_minutes_system1": [1, 600]}, "asks for 600, but .*system1 is 120"),
        ({"policy": "orstein"}, "did you mean 'ornstein_uhlenbeck'"),
        ({"validation_minutes": float("nan")}, "validation_minutes"),
        ({"ablation_minutes": [0.0]}, "ablation_minutes must be positive"),
        ({"p_expert_system2": 2}, "p_expert_system2 must be from 0 to 1"),
        ({"tuned": [["sidm", "weight_decai", 0.1]]}, "did you mean 'weight_decay'"),
    ],
)
def test_presets_refuse_what_no_preset_can_have(changes, words):
    with pytest.raises(ConfigError, match=words):
        load_preset("laptop", **changes)


def test_preset_changes_reach_network_and_training():
    preset = load_preset("laptop", pixels=64, max_samples=1000, p_expert_system2=0.25)
    assert (preset.network.pixels, preset.training.max_samples) == (64, 1000)
    assert preset.training_of(METHODS["sidm"], "system2").p_expert == 0.25
    parts = preset, preset.network, preset.training
    names = Counter(f.name for part in parts for f in dataclasses.fields(part))
    assert set(names.values()) == {1}


def test_methods_differ_only_in_their_training():
    """Training alone is the same loop without expert data and adversary (section 4)."""
    for system, p in (("system1", 0.75), ("system2", 0.5)):
        with_sidm, without = (
            Study("laptop").trial(system, m, 5) for m in ("sidm", "novice_only")
        )
        assert (with_sidm.training.p_expert, with_sidm.training.regularise) == (p, True)
        assert (without.training.p_expert, without.training.regularise) == (0.0, False)
        assert without.replace(method="sidm", training=with_sidm.training) == with_sidm


def keys(trials):
    return {trial.key for trial in trials}


def test_grids_share_trials_and_seeds_pair_the_methods():
    study = Study("laptop")
    trials, system = study.figure3("system1"), "system1"
    sidm, alone = (
        {(t.novice_minutes, t.seed) for t in trials if t.method == m} for m in COMPARED
    )
    assert sidm == alone and len(study.figure4()) == 2 * 3 * 10
    figure3, listed = keys(trials), baselines.trials(study, system)
    for some, shared in (
        (study.figure4(), 2 * 3 * 3),
        (ablations.p_expert(study, system), 3),  # p_e of 0.75, three seeds
        (ablations.phases(study, system), 3),  # 100, 20 and 5 iterations
        (ablations.pixels(study, system), 2 * 3),  # both methods
        (ablations.patience(study, system), 2 * 3),
        (listed, 3 * 2 * 3 + 3),  # three methods, two sizes, and all data
    ):
        assert len(keys(some) & figure3) == shared
    others = {*VARIANTS, *MIRRORED, *CORES, RIVAL}
    assert {t.method for t in listed} == {*METHODS} - others
    listed = variants.trials(study, system)
    # two at 20, 60, 120, too
    assert len(listed) == len(keys(listed)) == 15 * 4 * 3 + 2 * 3 * 3
    assert keys(variants.correction(study, system)) < keys(listed)
    assert len(grid("laptop", "3", "system2", minutes=[5, 20], seeds=[1])) == 2 * 3
    assert keys(grid("laptop", "all")) >= figure3


@pytest.mark.parametrize(
    ("words", "minutes", "message"),
    [
        ((), [3], "minutes 3 is not in this grid; it has 1, 2, 5, 20, 60, 120"),
        (("4", "system2"), None, "figure 4 has no trials of system2"),
        (("p_expert",), None, "did you mean 'p-expert'"),
    ],
)
def test_a_grid_names_what_it_has(words, minutes, message):
    with pytest.raises(ConfigError, match=message):
        grid("laptop", *words, minutes=minutes)


def test_the_study_has_grids_of_its_own():
    """Little data have more seeds; settings are chosen on motion of no figure."""
    study = Study("study")
    figures, laptop = (Study(name).figure3("system1") for name in ("study", "laptop"))
    seeds = Counter(t.novice_minutes for t in figures if t.method == "sidm")
    assert seeds == {1: 10, 2: 5, 5: 10, 20: 5, 60: 5, 120: 5}
    assert keys(laptop) < keys(figures)
    tried, long = tuning.trials(study, "system1"), duration.trials(study, "system1")
    experts = {t.datasets["expert"] for t in figures}
    assert {t.datasets["expert"] for t in tried} == experts
    novices = [
        {t.datasets[name] for t in some for name in ("novice", "validation", "rollout")}
        for some in (figures, tried, long)
    ]
    assert len(novices[0]) == 3 and not novices[0] & (novices[1] | novices[2])
    every = {d for t in [*figures, *tried] for d in t.datasets.values()}
    assert set(study.preset.all_datasets("system1")) == every
    assert {(t.training.batch, t.training.patience) for t in long} == {(8, 2_500_000)}
    whole = keys(grid("study", "all"))
    assert keys([*tried, *long]) < whole
    assert not keys(choices.trials(study, "system1")) & whole


def test_a_system_of_your_own_has_system_1s_sizes(monkeypatch):
    system = dataclasses.replace(SYSTEMS["system1"], name="soft")
    monkeypatch.setitem(SYSTEMS, "soft", system)
    preset = load_preset("smoke")
    trials = Study(preset).figure3("soft")
    assert {trial.system for trial in trials} == {"soft"}
    assert trials[0].pool_minutes == preset.pool_minutes_system1
    assert trials[0].training.p_expert == preset.p_expert_system1


def test_the_policies_of_a_preset_are_those_of_the_simulation():
    from sidm.simulation import POLICIES as simulated

    assert set(POLICIES) == set(simulated)


def test_robots_with_free_struts_have_motion_of_their_own():
    """They have the p_e of the braked robots, and are in no other preset."""
    free = grid(load_preset("study", p_expert_system2=0.125), "free-struts")
    assert {trial.system for trial in free} == set(FREE_SYSTEMS)
    shares = {t.system: t.training.p_expert for t in free if t.method == "sidm"}
    assert shares["system2_free_struts"] == 0.125 != shares["system1_free_struts"]
    every = grid("laptop", "all")
    assert {trial.system for trial in every} == set(SYSTEMS)
    experts = [
        {t.datasets["expert"].collection for t in some} for some in (free, every)
    ]
    assert experts[0].isdisjoint(experts[1])
