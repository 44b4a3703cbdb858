"""The table of the decisive experiment: its steps in the order in which they are run, and the trials of each.

Within a step what decides most comes first: 5 minutes with all seeds, then 1 and 20,
then 60 and 120.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

import pandas as pd

from companion.engine.store import Results
from companion.statistics.tables import overview
from companion.studies.decisive import search
from companion.studies.decisive.recipes import R, on_fresh_motion, to_the_cap
from companion.study import Study
from companion.trials import Trial
from sidm.systems import FREE_STRUTS, SYSTEMS

FINETUNING = "pretrain_finetune"
SEEDS, ALL_SEEDS, FEW_SEEDS = range(5), range(10), range(3)
#: min of novice data, in the order of their worth
ORDER = ((5.0,), (1.0, 20.0), (60.0, 120.0))
MILLION = 1_000_000
#: method -> min of novice data -> samples of a training
Caps = Mapping[str, Mapping[float, int]]

#: What each recipe compares, and how long.
R_CAPS: Caps = {
    "sidm": dict.fromkeys((5.0, 1.0, 20.0), 8 * MILLION),
    "novice_only": {5.0: 8 * MILLION}
    | dict.fromkeys((1.0, 20.0, 60.0, 120.0), 4 * MILLION),
}
T_CAPS: Caps = {
    "sidm": dict.fromkeys((5.0, 1.0, 20.0), 6 * MILLION),
    "novice_only": dict.fromkeys((5.0, 1.0, 20.0, 60.0, 120.0), 6 * MILLION),
    FINETUNING: dict.fromkeys((5.0, 1.0, 20.0), 3 * MILLION),
}


def only(caps: Caps, sizes: Mapping[str, tuple[float, ...]]) -> Caps:
    """Some methods of a recipe, with some of their sizes, in minutes."""
    return {
        method: {minutes: caps[method][minutes] for minutes in some}
        for method, some in sizes.items()
    }


RECIPES: dict[str, Caps] = {"R": R_CAPS, "T": T_CAPS}
AT_FIVE: dict[str, tuple[float, ...]] = {"sidm": (5.0,), "novice_only": (5.0,)}
AT_FIVE_AND_TWENTY: dict[str, tuple[float, ...]] = {
    "sidm": (5.0,),
    "novice_only": (5.0, 20.0),
}


class Step(NamedTuple):
    """A part of the table."""

    name: str
    words: str
    trainings: int  # that it plans
    trials: Callable[[Study], list[Trial]]  # none while the settings are not chosen


def settings(recipe: str, system: str, method: str) -> dict | None:
    """Changes of an untuned preset for a recipe's method; None while the search has not chosen them."""
    if recipe == "R":
        return R
    chosen = search.CHOSEN.get(system.removesuffix(FREE_STRUTS), {}).get(method)
    return None if chosen is None else search.draw(method, chosen).changes


def arm(
    study: Study,
    recipe: str,
    system: str,
    caps: Caps,
    seeds: Iterable[int],
    policy: str | None = None,
) -> list[Trial]:
    """Trainings of a recipe on a system, in the order of their worth."""
    found, fresh = [], on_fresh_motion(study)
    if policy is not None:
        fresh = fresh.changed(policy=policy)
    for sizes in ORDER:
        for seed in seeds:
            for minutes in sizes:
                for method in (method for method in caps if minutes in caps[method]):
                    changes = settings(recipe, system, method)
                    if changes is not None:
                        own = fresh.changed(
                            **changes | to_the_cap(caps[method][minutes])
                        )
                        found.append(own.trial(system, method, minutes, seed))
    return found


def other_motion(study: Study) -> list[Trial]:
    """Step C: free struts with both recipes, and another exploration policy with R."""
    found = [
        trial
        for system in SYSTEMS
        for recipe, caps in RECIPES.items()
        for trial in arm(
            study, recipe, system + FREE_STRUTS, only(caps, AT_FIVE), FEW_SEEDS
        )
    ]
    return found + arm(
        study, "R", "system1", only(R_CAPS, AT_FIVE), FEW_SEEDS, policy="bounded_noise"
    )


def more_seeds(study: Study) -> list[Trial]:
    """Step D: seeds five to nine."""
    seeds = [seed for seed in ALL_SEEDS if seed not in SEEDS]
    arms = [
        (recipe, system, only(caps, AT_FIVE_AND_TWENTY))
        for recipe, caps in RECIPES.items()
        for system in SYSTEMS
    ]
    return [
        trial
        for recipe, system, caps in arms
        for trial in arm(study, recipe, system, caps, seeds)
    ]


STEPS = (
    Step("0", "search, system 1", 40, search.first_search),
    Step(
        "0 again",
        "the two best of each method with two more seeds",
        12,
        search.best_again,
    ),
    Step("0 units", "R with raw and standardised units", 8, search.units),
    Step(
        "A1", "R, system 1", 40, lambda study: arm(study, "R", "system1", R_CAPS, SEEDS)
    ),
    Step(
        "B1", "T, system 1", 55, lambda study: arm(study, "T", "system1", T_CAPS, SEEDS)
    ),
    Step(
        "A2", "R, system 2", 40, lambda study: arm(study, "R", "system2", R_CAPS, SEEDS)
    ),
    Step("0'", "search, system 2", 18, search.second_search),
    Step(
        "B2", "T, system 2", 55, lambda study: arm(study, "T", "system2", T_CAPS, SEEDS)
    ),
    Step("C", "free struts, R and T; another policy, R", 30, other_motion),
    Step("D", "seeds 5 to 9 at 5 min, and training alone at 20", 60, more_seeds),
)


def trials(study: Study, system: str) -> list[Trial]:
    """All trials of a system that are known, step by step."""
    return [
        trial
        for step in STEPS
        for trial in step.trials(study)
        if trial.system == system
    ]


def in_order(trials: Iterable[Trial], study: Study) -> list[Trial]:
    """Some of the table's trials in the order in which they are run."""
    ranks: dict[str, int] = {}
    for step in STEPS:
        for trial in step.trials(study):
            ranks.setdefault(trial.key, len(ranks))
    return sorted(trials, key=lambda trial: ranks[trial.key])


def progress(study: Study, store: Results) -> pd.DataFrame:
    """A line a step: what it is, trainings `planned`, `stored` and `failed`, their `core_hours` and samples a second.

    Least squares, which takes seconds, does not count. Hours of a training that was
    interrupted are those of its last stretch; samples a second are of trainings without
    one, their pretraining left aside.
    """
    lines = []
    for step in STEPS:
        trainings = [trial for trial in step.trials(study) if not trial.solved]
        made = store.frame(trainings)
        whole = made[~made.resumed.astype(bool) & made.pretraining_max_samples.isna()]
        pace = (
            whole.samples.sum() / max(whole.seconds.sum(), 1e-9)
            if len(whole)
            else float("nan")
        )
        lines.append(
            (
                step.name,
                step.words,
                step.trainings,
                len(made),
                len(store.failures(trainings)),
                made.seconds.sum() / 3600,
                pace,
            )
        )
    names = [
        "step",
        "what",
        "planned",
        "stored",
        "failed",
        "core_hours",
        "samples_a_second",
    ]
    return pd.DataFrame(lines, columns=names)


def listed(
    study: Study, store: Results, trials: Iterable[Trial]
) -> tuple[list[str], int]:
    """Some of the table's trials for people, step by step, and how many trainings have no settings yet."""
    lines, unknown, wanted = [], 0, {trial.key for trial in trials}
    for step, line in zip(STEPS, progress(study, store).itertuples(), strict=True):
        words = f"step {step.name}: {step.words}: {line.stored} of {step.trainings} trainings stored"
        if line.stored:
            words += f", {line.core_hours:.1f} core-hours, {line.samples_a_second:.0f} samples a second"
        known = step.trials(study)
        shown = overview(
            store, [trial for trial in known if trial.key in wanted], study
        )
        lacking = step.trainings - sum(not trial.solved for trial in known)
        later = (
            [f"  {lacking} trainings with settings that the search has not chosen yet"]
            if lacking
            else []
        )
        lines += [words, *(f"  {text}" for text in shown), *later]
        unknown += lacking
    return lines, unknown
