"""The table of the decisive experiment: its steps in the order in which they are run, and the trials of each."""

from __future__ import annotations

from collections.abc import Callable

from sidm.experiments.studies.decisive import search
from sidm.experiments.study import Study
from sidm.experiments.trials import Trial


def first_search(study: Study) -> list[Trial]:
    """Step 0: the draws of each method on system 1, and the yardstick of their splits."""
    draws = list(search.first_draws())
    found = [search.trial_of(study, "system1", one, search.FIRST_SEED + one.number) for one in draws]
    seeds = dict.fromkeys(trial.seed for trial in found)
    return found + [search.yardstick(study, "system1", seed) for seed in seeds]


#: Step -> what makes its trials.
STEPS: dict[str, Callable[[Study], list[Trial]]] = {"0": first_search}


def trials(study: Study, system: str) -> list[Trial]:
    """All trials of a system, step by step."""
    return [trial for step in STEPS.values() for trial in step(study) if trial.system == system]
