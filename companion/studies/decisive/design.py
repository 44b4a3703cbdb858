"""The steps of the decisive experiment in the order of their run, with their trials."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from companion.engine.store import Results
from companion.statistics.tables import overview
from companion.studies.decisive import arms, search
from companion.studies.decisive.arms import (
    ALL_SEEDS,
    FEW_SEEDS,
    R_CAPS,
    RECIPES,
    SEEDS,
    arm,
    at_five,
    restricted,
)
from companion.study import Study
from companion.trials import Trial
from sidm.config import unknown_name
from sidm.systems import FREE_STRUTS, PAPER_SYSTEMS


class Step(NamedTuple):
    """A step of the experiment."""

    name: str
    description: str
    trainings: int  # number of trainings that the step plans
    #: the trials of a study; without those whose settings are not chosen yet
    trials: Callable[[Study], list[Trial]]


def whole_arm(recipe: str, system: str, study: Study) -> list[Trial]:
    """Steps A and B: all methods and sizes of a recipe on a system."""
    return arm(study, recipe, system, RECIPES[recipe], SEEDS)


def other_motion(study: Study) -> list[Trial]:
    """Step C: free struts with both recipes, and another exploration policy with R."""
    trials = []
    for system, recipe in itertools.product(PAPER_SYSTEMS, RECIPES):
        caps = at_five(RECIPES[recipe])
        trials += arm(study, recipe, system + FREE_STRUTS, caps, FEW_SEEDS)
    caps = at_five(R_CAPS)
    noisy = study.changed(policy="bounded_noise")
    return trials + arm(noisy, "R", "system1", caps, FEW_SEEDS)


def more_seeds(study: Study) -> list[Trial]:
    """Step D: seeds five to nine."""
    seeds = [seed for seed in ALL_SEEDS if seed not in SEEDS]
    trials = []
    for recipe, system in itertools.product(RECIPES, PAPER_SYSTEMS):
        caps = restricted(RECIPES[recipe], sidm=(5.0,), novice_only=(5.0, 20.0))
        trials += arm(study, recipe, system, caps, seeds)
    return trials


STEPS = (
    Step("0", "search, system 1", 40, search.first_search),
    Step(
        "0 again",
        "the two best of each method with two more seeds",
        12,
        search.best_repeated,
    ),
    Step("0 units", "R with raw and standardised units", 8, search.compare_units),
    Step("A1", "R, system 1", 40, functools.partial(whole_arm, "R", "system1")),
    Step("B1", "T, system 1", 55, functools.partial(whole_arm, "T", "system1")),
    Step("A2", "R, system 2", 40, functools.partial(whole_arm, "R", "system2")),
    Step("0'", "search, system 2", 18, search.second_search),
    Step("B2", "T, system 2", 55, functools.partial(whole_arm, "T", "system2")),
    Step("C", "free struts, R and T; another policy, R", 30, other_motion),
    Step("D", "seeds 5 to 9 at 5 min, and training alone at 20", 60, more_seeds),
    Step("E1", "R with one setting changed: p_e, phases", 48, arms.ablations),
    Step("E1 again", "R and its long phases, each phase's loss", 6, arms.both_phases),
    Step("E2", "the SIDM with the rival's decay, system 1", 6, arms.rivals_decay),
    Step("E3", "T, system 2, what decides at 5 min", 25, arms.tuned_on_system2),
    Step("E4", "R until its own rule ends it, system 1", 15, arms.to_its_rule),
    Step("E5", "R with maps of 64 pixels, system 1", 9, arms.released_maps),
)


def trials(study: Study, system: str) -> list[Trial]:
    """All trials of a system whose settings are known, step by step."""
    every = (trial for step in STEPS for trial in step.trials(study))
    return [trial for trial in every if trial.system == system]


def in_order(
    trials: Iterable[Trial], study: Study, steps: Sequence[str] | None = None
) -> list[Trial]:
    """Trials of the experiment, sorted into the order in which they are run.

    With `steps`, only trials of steps of these names are kept; an unknown name raises
    ConfigError.
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


def overview_by_step(
    study: Study, store: Results, trials: Iterable[Trial]
) -> tuple[list[str], int]:
    """Lines about trials, and how many planned trainings have no settings yet.

    They count where all trials are asked for; a step whose trials are all of an earlier
    step plans no others. Least squares, which takes seconds, does not count. The hours
    of a training that was interrupted are those of its last stretch; samples a second
    are of the trainings that were not interrupted and have no pretraining.
    """
    lines, unknown, seen = [], 0, set[str]()
    wanted = {trial.key for trial in trials}
    for step in STEPS:
        known = step.trials(study)
        keys = {trial.key for trial in known}
        trainings = [trial for trial in known if not trial.solved]
        stored = store.frame(trainings)
        title = (
            f"step {step.name}: {step.description}: "
            f"{len(stored)} of {step.trainings} trainings stored"
        )
        if len(stored):
            whole = ~stored.resumed.astype(bool) & stored.pretraining_max_samples.isna()
            samples, seconds = stored[whole][["samples", "seconds"]].sum()
            pace = samples / max(seconds, 1e-9) if whole.any() else float("nan")
            hours = stored.seconds.sum() / 3600
            title += f", {hours:.1f} core-hours, {pace:.0f} samples a second"
        shown = [trial for trial in known if trial.key in wanted]
        lines += [title, *(f"  {line}" for line in overview(store, shown, study))]
        lacking = step.trainings - len(trainings)
        if lacking:
            lines.append(
                f"  {lacking} trainings with settings "
                "that the search has not chosen yet"
            )
        unknown += 0 if keys <= seen else lacking
        seen |= keys
    return lines, unknown if seen <= wanted else 0
