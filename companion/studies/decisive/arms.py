"""The arms of the decisive experiment: recipes with their methods, sizes and lengths.

Within an arm the most decisive trainings come first: 5 minutes with all seeds, then 1
and 20, then 60 and 120.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping

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
    policy: str | None = None,
) -> list[Trial]:
    """Trials of a recipe on a system, the most decisive sizes first.

    `caps` have the methods and sizes; `policy` is the exploration policy of all motion,
    by default the preset's.
    """
    trials, fresh = [], on_fresh_motion(study)
    if policy is not None:
        fresh = fresh.changed(policy=policy)
    for sizes in ORDER:
        for seed, minutes, method in itertools.product(seeds, sizes, caps):
            changes = settings(recipe, system, method)
            if minutes in caps[method] and changes is not None:
                length = without_early_stopping(caps[method][minutes])
                changed = fresh.changed(**changes | length)
                trials.append(changed.trial(system, method, minutes, seed))
    return trials
