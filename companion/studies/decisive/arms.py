"""The arms of the decisive experiment: recipes with their methods, sizes and lengths.

Within an arm the most decisive trainings come first: 5 minutes with all seeds, then 1
and 20, then 60 and 120.

Steps E1 to E5 are what the first steps left open. The page on claims has their rules.
E1 changes one setting of recipe R at a time: p_e, or the iterations of a phase. E2
gives the SIDM the weight decay that its rival was chosen with. E3 is recipe T on system
2. E4 trains R until the released rule, not our cap, ends it. E5 has the release's maps.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from typing import Any

from companion.studies.decisive import search
from companion.studies.decisive.recipes import (
    R,
    on_fresh_motion,
    without_early_stopping,
)
from companion.study import Study
from companion.trials import Trial
from sidm.systems import FREE_STRUTS

FINETUNING = "pretrain_finetune"
SEEDS, ALL_SEEDS, FEW_SEEDS = range(5), range(10), range(3)
#: min of novice data, the most decisive sizes first
ORDER = ((5.0,), (1.0, 20.0), (60.0, 120.0))
MILLION = 1_000_000
#: method -> min of novice data -> samples of a training
Caps = Mapping[str, Mapping[float, int]]

#: Methods and sizes that recipe R compares, with the samples of each training.
R_CAPS: Caps = {
    "sidm": dict.fromkeys((5.0, 1.0, 20.0), 8 * MILLION),
    "novice_only": {5.0: 8 * MILLION}
    | dict.fromkeys((1.0, 20.0, 60.0, 120.0), 4 * MILLION),
}
#: Methods and sizes that recipe T compares, with the samples of each training.
T_CAPS: Caps = {
    "sidm": dict.fromkeys((5.0, 1.0, 20.0), 6 * MILLION),
    "novice_only": dict.fromkeys((5.0, 1.0, 20.0, 60.0, 120.0), 6 * MILLION),
    FINETUNING: dict.fromkeys((5.0, 1.0, 20.0), 3 * MILLION),
}
RECIPES: dict[str, Caps] = {"R": R_CAPS, "T": T_CAPS}

MINUTES = 5.0  # of novice data, in E1 and E2
#: system -> samples of a training of E1
ABLATION_CAPS = {"system1": 6 * MILLION, "system2": 4 * MILLION}
#: settings of R that E1 changes, one at a time -> their values; R's own come from steps
#: A1 and A2
ABLATED: dict[str, tuple[float, ...]] = {
    "p_expert": (0.25, 0.5, 0.75, 0.9),
    "matching_iterations": (0, 5, 100),
    "prediction_iterations": (20, 500),
}
#: setting -> R's value, by system where systems differ
OF_R: dict[str, dict[str, float]] = {
    "p_expert": {"system1": 0.75, "system2": 0.5},
    "matching_iterations": dict.fromkeys(ABLATION_CAPS, 20),
    "prediction_iterations": dict.fromkeys(ABLATION_CAPS, 100),
}
#: changes of E1 that make one phase five times as long
LONG_PHASES = ("matching_iterations", 100), ("prediction_iterations", 500)
#: draws of step 0 whose decay is near the rival's, still improving when they were cut
DECAY_DRAWS = (8, 17)
DECAY_CAP = 16 * MILLION  # 6 to 7 of them the novice's, as many as the rival sees


def restricted(caps: Caps, **sizes: tuple[float, ...]) -> Caps:
    """The entries of `caps` for some methods and their sizes, min."""
    return {name: {size: caps[name][size] for size in of} for name, of in sizes.items()}


def at_five(caps: Caps) -> Caps:
    """The entries of `caps` for the paper's two methods with 5 minutes."""
    return restricted(caps, sidm=(5.0,), novice_only=(5.0,))


def settings(recipe: str, system: str, method: str) -> dict | None:
    """Changes of an untuned preset that make a method follow a recipe on a system.

    None where the search has not chosen the settings yet.
    """
    if recipe == "R":
        return R
    chosen = search.CHOSEN.get(system.removesuffix(FREE_STRUTS), {}).get(method)
    return None if chosen is None else search.draw(method, chosen)


def arm(
    study: Study,
    recipe: str,
    system: str,
    caps: Caps,
    seeds: Iterable[int],
) -> list[Trial]:
    """Trials of a recipe on a system, the most decisive sizes first.

    `caps` have the methods and sizes.
    """
    trials, fresh = [], on_fresh_motion(study)
    for sizes in ORDER:
        for seed, minutes, method in itertools.product(seeds, sizes, caps):
            changes = settings(recipe, system, method)
            if minutes in caps[method] and changes is not None:
                length = without_early_stopping(caps[method][minutes])
                changed = fresh.changed(**changes | length)
                trials.append(changed.trial(system, method, minutes, seed))
    return trials


def _at_five(
    study: Study, system: str, seed: int, cap: int, changes: dict[str, Any]
) -> Trial:
    """The training of an SIDM with changed settings to so many samples."""
    changed = on_fresh_motion(study).changed(**changes | without_early_stopping(cap))
    return changed.trial(system, "sidm", MINUTES, seed)


def ablated(study: Study, system: str, setting: str, value: float, seed: int) -> Trial:
    """The training of E1 with one setting of R changed."""
    name = f"p_expert_{system}" if setting == "p_expert" else setting
    return _at_five(study, system, seed, ABLATION_CAPS[system], R | {name: value})


def ablations(study: Study) -> list[Trial]:
    """Step E1, seed by seed."""
    return [
        ablated(study, system, setting, value, seed)
        for seed in FEW_SEEDS
        for setting, values in ABLATED.items()
        for value in values
        for system in ABLATION_CAPS
        if value != OF_R[setting][system]
    ]


def both_phases(study: Study) -> list[Trial]:
    """Step E1 again: R with seed 0, to the caps of E1, then with each long phase.

    A1 and A2 stored neither the matching loss nor the discriminator's accuracy.
    """
    changes = ("matching_iterations", 20), *LONG_PHASES
    return [
        ablated(study, system, setting, value, 0)
        for setting, value in changes
        for system in ABLATION_CAPS
    ]


def rivals_decay(study: Study) -> list[Trial]:
    """Step E2: two draws of the search, trained five times as long."""
    return [
        _at_five(study, "system1", seed, DECAY_CAP, search.draw("sidm", number))
        for seed in FEW_SEEDS
        for number in DECAY_DRAWS
    ]


def tuned_on_system2(study: Study) -> list[Trial]:
    """Step E3: the trainings of step B2 that decide at 5 minutes."""
    sizes = {"sidm": (5.0,), "novice_only": (5.0, 1.0, 20.0)}
    caps = restricted(T_CAPS, **sizes, pretrain_finetune=(5.0,))
    return arm(study, "T", "system2", caps, SEEDS)


def to_its_rule(study: Study) -> list[Trial]:
    """Step E4."""
    caps = {
        "novice_only": {20.0: 8 * MILLION, 60.0: 16 * MILLION, 120.0: 16 * MILLION},
        "sidm": dict.fromkeys((60.0, 120.0), 20 * MILLION),
    }
    return arm(study, "R", "system1", caps, FEW_SEEDS)


def released_maps(study: Study) -> list[Trial]:
    """Step E5: maps of 64 pixels."""
    caps = {
        "sidm": {5.0: 8 * MILLION},
        "novice_only": {5.0: 8 * MILLION, 20.0: 5 * MILLION},
    }
    return arm(study.changed(pixels=64), "R", "system1", caps, FEW_SEEDS)
