"""The steps of the decisive experiment in the order of their run, with their trials.

Within a step the most decisive trainings come first: 5 minutes with all seeds, then 1
and 20, then 60 and 120.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import pandas as pd

from companion.engine.store import Results
from companion.statistics.tables import overview
from companion.studies.decisive import search
from companion.studies.decisive.recipes import (
    R,
    on_fresh_motion,
    without_early_stopping,
)
from companion.study import Study
from companion.trials import Trial
from sidm.config import unknown_name
from sidm.systems import FREE_STRUTS, SYSTEMS

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

#: method -> min of novice data
Sizes = Mapping[str, tuple[float, ...]]
AT_FIVE: Sizes = {"sidm": (5.0,), "novice_only": (5.0,)}
AT_FIVE_AND_TWENTY: Sizes = {"sidm": (5.0,), "novice_only": (5.0, 20.0)}


def restricted(caps: Caps, sizes: Sizes) -> Caps:
    """The entries of `caps` for the methods of `sizes` and their sizes, in minutes."""
    return {
        method: {size: caps[method][size] for size in method_sizes}
        for method, method_sizes in sizes.items()
    }


class Step(NamedTuple):
    """A step of the experiment."""

    name: str
    description: str
    trainings: int  # number of trainings that the step plans
    #: the trials of a study; without those whose settings are not chosen yet
    trials: Callable[[Study], list[Trial]]


def settings(recipe: str, system: str, method: str) -> dict | None:
    """Changes of an untuned preset that make a method follow a recipe on a system.

    Returns None where the search has not chosen the settings yet.
    """
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
    """Trials of a recipe on a system, the most decisive sizes first.

    Args:
        study: preset, data and results.
        recipe: a key of RECIPES.
        system: name of the pair of robots.
        caps: methods and sizes, with the samples of each training.
        seeds: of the trials.
        policy: exploration policy of all motion; the preset's by default.
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


def other_motion(study: Study) -> list[Trial]:
    """Step C: free struts with both recipes, and another exploration policy with R."""
    trials = []
    for system, recipe in itertools.product(SYSTEMS, RECIPES):
        caps = restricted(RECIPES[recipe], AT_FIVE)
        trials += arm(study, recipe, system + FREE_STRUTS, caps, FEW_SEEDS)
    caps = restricted(R_CAPS, AT_FIVE)
    return trials + arm(study, "R", "system1", caps, FEW_SEEDS, policy="bounded_noise")


def more_seeds(study: Study) -> list[Trial]:
    """Step D: seeds five to nine."""
    seeds = [seed for seed in ALL_SEEDS if seed not in SEEDS]
    trials = []
    for recipe, system in itertools.product(RECIPES, SYSTEMS):
        caps = restricted(RECIPES[recipe], AT_FIVE_AND_TWENTY)
        trials += arm(study, recipe, system, caps, seeds)
    return trials


def _arm_step(name: str, recipe: str, number: int, trainings: int) -> Step:
    """A step with all methods and sizes of a recipe on the system of that number."""

    def trials(study: Study) -> list[Trial]:
        return arm(study, recipe, f"system{number}", RECIPES[recipe], SEEDS)

    return Step(name, f"{recipe}, system {number}", trainings, trials)


STEPS = (
    Step("0", "search, system 1", 40, search.first_search),
    Step(
        "0 again",
        "the two best of each method with two more seeds",
        12,
        search.best_repeated,
    ),
    Step("0 units", "R with raw and standardised units", 8, search.compare_units),
    _arm_step("A1", "R", 1, 40),
    _arm_step("B1", "T", 1, 55),
    _arm_step("A2", "R", 2, 40),
    Step("0'", "search, system 2", 18, search.second_search),
    _arm_step("B2", "T", 2, 55),
    Step("C", "free struts, R and T; another policy, R", 30, other_motion),
    Step("D", "seeds 5 to 9 at 5 min, and training alone at 20", 60, more_seeds),
)


def trials(study: Study, system: str) -> list[Trial]:
    """All trials of a system whose settings are known, step by step."""
    return [
        trial
        for step in STEPS
        for trial in step.trials(study)
        if trial.system == system
    ]


def in_order(
    trials: Iterable[Trial], study: Study, steps: Sequence[str] | None = None
) -> list[Trial]:
    """Trials of the experiment, sorted into the order in which they are run.

    Args:
        trials: some of the experiment's.
        study: preset, data and results.
        steps: names of steps whose trials are kept; by default all.

    Raises:
        ConfigError: there is no step of a name.
    """
    known = [step.name for step in STEPS]
    for name in steps or ():
        if name not in known:
            raise unknown_name(name, known, kind="step")
    ranks: dict[str, int] = {}
    for step in STEPS:
        if steps is None or step.name in steps:
            for trial in step.trials(study):
                ranks.setdefault(trial.key, len(ranks))
    kept = (trial for trial in trials if trial.key in ranks)
    return sorted(kept, key=lambda trial: ranks[trial.key])


def progress(study: Study, store: Results) -> pd.DataFrame:
    """How far each step is: a row per step.

    Least squares, which takes seconds, does not count. The hours of a training that was
    interrupted are those of its last stretch.

    Returns:
        The `step` and `what` it is, the numbers of trainings `planned`, `stored` and
        `failed`, their `core_hours`, and `samples_a_second` of the trainings that were
        not interrupted and have no pretraining.
    """
    rows = []
    for step in STEPS:
        trainings = [trial for trial in step.trials(study) if not trial.solved]
        stored = store.frame(trainings)
        whole = stored[
            ~stored.resumed.astype(bool) & stored.pretraining_max_samples.isna()
        ]
        pace = float("nan")
        if len(whole):
            pace = whole.samples.sum() / max(whole.seconds.sum(), 1e-9)
        rows.append(
            {
                "step": step.name,
                "what": step.description,
                "planned": step.trainings,
                "stored": len(stored),
                "failed": len(store.failures(trainings)),
                "core_hours": stored.seconds.sum() / 3600,
                "samples_a_second": pace,
            }
        )
    return pd.DataFrame(rows)


def overview_by_step(
    study: Study, store: Results, trials: Iterable[Trial]
) -> tuple[list[str], int]:
    """Lines of text about trials of the experiment, step by step.

    Returns:
        The lines, and the number of planned trainings that have no settings yet.
    """
    lines, unknown, wanted = [], 0, {trial.key for trial in trials}
    for step, row in zip(STEPS, progress(study, store).itertuples(), strict=True):
        title = (
            f"step {step.name}: {step.description}: "
            f"{row.stored} of {step.trainings} trainings stored"
        )
        if row.stored:
            title += (
                f", {row.core_hours:.1f} core-hours, "
                f"{row.samples_a_second:.0f} samples a second"
            )
        known = step.trials(study)
        shown = [trial for trial in known if trial.key in wanted]
        lines += [title, *(f"  {line}" for line in overview(store, shown, study))]
        lacking = step.trainings - sum(not trial.solved for trial in known)
        if lacking:
            lines.append(
                f"  {lacking} trainings with settings "
                "that the search has not chosen yet"
            )
        unknown += lacking
    return lines, unknown
