"""What the tries of the tuning came to: their losses, a check on the other system, and the settings that follow."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from sidm.experiments.engine.store import Results, Row
from sidm.experiments.methods import METHODS
from sidm.experiments.presets import Preset
from sidm.experiments.study import Study
from sidm.experiments.trials import Trial
from sidm.experiments.tries import TRIES, TUNING_SEED, tried
from sidm.systems import SYSTEMS


class Try(NamedTuple):
    """A line of the table of tries."""

    system: str
    method: str
    words: str
    test_loss: float  # smoothed, of the weights that were kept: what the choice goes by
    validation_loss: float
    samples: int  # of prediction, the pretraining's among them
    lowest: bool  # the first of the lowest test loss of its method and system
    used: bool  # what the preset has


def trials(study: Study, system: str) -> list[Trial]:
    """Every try of every method at each of the tuning's sizes, with a seed that no figure has."""
    base = study.preset.for_tuning()
    every = [(method, words) for method, tries in TRIES.items() for words in tries]
    return [
        study.of(tried(base, method, words)).trial(system, method, minutes, TUNING_SEED)
        for minutes in base.tuning_minutes
        for method, words in every
    ]


def tries_table(study: Study, systems: Iterable[str], store: Results) -> list[Try]:
    """The stored tries of some systems."""
    systems, base = list(systems), study.of(study.preset.for_tuning())
    words = [one for tries in TRIES.values() for one in tries] * len(base.preset.tuning_minutes)
    every = [pair for system in systems for pair in zip(trials(study, system), words, strict=True)]
    found = [(row, one) for trial, one in every if (row := store.get(trial)) is not None]
    used = {
        base.trial(system, method, minutes, TUNING_SEED).key
        for system in systems for method in TRIES for minutes in base.preset.tuning_minutes
    }  # fmt: skip
    best: dict[tuple[str, str, float], Row] = {}
    for row, _ in found:
        key = row.trial.system, row.trial.method, row.trial.novice_minutes
        if key not in best or row.outcome.best_test_loss < best[key].outcome.best_test_loss:
            best[key] = row
    return [
        Try(
            row.trial.system,
            row.trial.method,
            one,
            row.outcome.best_test_loss,
            row.outcome.validation_loss,
            row.outcome.samples + row.outcome.pretraining_samples,
            row is best[row.trial.system, row.trial.method, row.trial.novice_minutes],
            row.trial.key in used,
        )
        for row, one in found
    ]


def check(tries: Sequence[Try]) -> str:
    """Whether what the preset has is the best on each system too, as a sentence a system."""
    said = []
    for system in dict.fromkeys(one.system for one in tries):
        lowest = {one.method: one for one in tries if one.system == system and one.lowest}
        used = {one.method: one for one in tries if one.system == system and one.used}
        common = lowest.keys() & used.keys()
        same = sum(lowest[method].words == used[method].words for method in common)
        above = max((used[method].test_loss / lowest[method].test_loss - 1 for method in common), default=0.0)
        far = f", and at most {above:.1%} above it for the others" if same < len(common) else ""
        said.append(f"On {system} the try used has the lowest test loss for {same} of {len(common)} methods{far}.")
    return " ".join(said)


#: What was tuned, as a training names it.
TUNED = (
    "learning_rate", "batch", "weight_decay", "patience",
    "prediction_iterations", "discriminator_iterations", "matching_iterations",
)  # fmt: skip


def settings_table(preset: Preset) -> list[tuple]:
    """What each method came to, a line a setting: its name, then the value of each method of TRIES.

    A pretraining's value stands before the fine-tuning's where they differ, p_e before the systems.
    """
    lines: list[tuple] = [("p_expert", *(_p_expert(preset, method) for method in TRIES))]
    for name in TUNED:
        line: list[str] = []
        for method in TRIES:
            training, first = METHODS[method].training(preset, "system1"), METHODS[method].pretraining(preset)
            both = [getattr(one, name) for one in (first, training) if one is not None]
            silent = name in TUNED[-2:] and not training.regularise or name == TUNED[-3] and not METHODS[method].expert
            line.append("-" if silent else ", then ".join(dict.fromkeys(f"{value:,g}" for value in both)))
        lines.append((name, *line))
    return lines


def _p_expert(preset: Preset, method: str) -> str:
    """The p_e of a method, a system after the other."""
    if not METHODS[method].expert:
        return "-"
    return ", ".join(f"{METHODS[method].training(preset, system).p_expert:g} ({system})" for system in SYSTEMS)
