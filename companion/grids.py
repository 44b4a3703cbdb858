"""The grids of trials, by the name of the figure that they are for, and what they cost."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd

from companion.engine.store import Results
from companion.presets import Preset
from companion.studies import (
    ablations,
    baselines,
    choices,
    corrected_claim,
    duration,
    network_size,
    other_bodies,
    tuning,
    variants,
)
from companion.studies.decisive import design as decisive
from companion.study import Study
from companion.trials import Trial
from sidm.config import ConfigError, unknown_name
from sidm.systems import FREE_SYSTEMS, SYSTEMS, find_system

#: Figure -> what makes its trials of one system, and the systems that it has.
FIGURES: dict[str, tuple[Callable[[Study, str], list[Trial]], tuple[str, ...]]] = {
    "decisive": (decisive.trials, (*SYSTEMS, *FREE_SYSTEMS)),
    "duration": (duration.trials, ("system1",)),
    "3": (Study.figure3, tuple(SYSTEMS)),
    "references": (Study.references, tuple(SYSTEMS)),
    "4": (Study.figure4, ("system1",)),
    "tuning": (tuning.trials, tuple(SYSTEMS)),
    "little-data": (tuning.little_data, tuple(SYSTEMS)),
    "choices": (choices.trials, tuple(SYSTEMS)),
    "released": (choices.released, tuple(SYSTEMS)),
    "baselines": (baselines.trials, tuple(SYSTEMS)),
    "variants": (variants.trials, tuple(SYSTEMS)),
    "p-expert": (ablations.p_expert, tuple(SYSTEMS)),
    "iterations": (ablations.phases, tuple(SYSTEMS)),
    "pixels": (ablations.pixels, tuple(SYSTEMS)),
    "patience": (ablations.patience, tuple(SYSTEMS)),
    "other-bodies": (other_bodies.trials, ("system1",)),
    "free-struts": (Study.free_struts, tuple(FREE_SYSTEMS)),
    "network-size": (network_size.trials, ("system1",)),
    "corrected-claim": (corrected_claim.trials, corrected_claim.PAIRS),
    "most-data": (ablations.most_data_trials, tuple(SYSTEMS)),
}

#: Grids of presets that name them.
NAMED = (
    "decisive",
    "duration",
    "little-data",
    "free-struts",
    "network-size",
    "corrected-claim",
)

#: What grids were called before.
FORMER = {"yardsticks": "references", "ample": "most-data"}


def figures_of(preset: Preset) -> tuple[str, ...]:
    """Names of a preset's grids."""
    return preset.figures or tuple(name for name in FIGURES if name not in NAMED)


def grid(
    preset: Preset | str,
    figure: str = "3",
    system: str | None = None,
    minutes: Sequence[float] | None = None,
    seeds: Sequence[int] | None = None,
    data: str | Path = "data",
    results: str | Path = "results",
) -> list[Trial]:
    """The trials behind a figure, each once.

    Args:
        preset: a Preset or the name of one.
        figure: one of FIGURES, or 'all' that the preset has.
        system: only this system's.
        minutes: only these novice dataset sizes.
        seeds: only these seeds.
        data: where the shards lie, whose digests make part of a trial.
        results: where the digests of the stored study lie.

    Raises:
        ConfigError: a name that does not exist, or sizes or seeds that the figure does
            not have.
    """
    if figure in FORMER:
        raise ConfigError(f"figure '{figure}' is called '{FORMER[figure]}' now")
    if figure not in (*FIGURES, "all"):
        raise unknown_name(figure, (*FIGURES, "all"), "the figures")
    if system is not None:
        find_system(system)
    study = Study(preset, data, results)
    found: dict[str, Trial] = {}
    for name in figures_of(study.preset) if figure == "all" else (figure,):
        maker, systems = FIGURES[name]
        for one in systems:
            if system in (None, one):
                found |= {trial.key: trial for trial in maker(study, one)}
    trials = list(found.values())
    if figure == "decisive":
        trials = decisive.in_order(trials, study)  # across systems
    if not trials:
        raise ConfigError(
            f"figure {figure} has no trials of {system}, only of {', '.join(FIGURES[figure][1])}"
        )
    for name, wanted, of in (
        ("minutes", minutes, "novice_minutes"),
        ("seeds", seeds, "seed"),
    ):
        if wanted is not None:
            known = sorted({getattr(trial, of) for trial in trials})
            strange = [value for value in wanted if value not in known]
            if strange:
                listed = ", ".join(f"{value:g}" for value in known)
                raise ConfigError(
                    f"{name} {strange[0]:g} is not in this grid; it has {listed}"
                )
            trials = [trial for trial in trials if getattr(trial, of) in wanted]
    return trials


def figure_costs(study: Study, store: Results) -> pd.DataFrame:
    """A line a `figure` of a study, whose `trials` count in each that they serve; of those `stored` what they took.

    `hours` of one processor or GPU all together, the pretraining in the trials that did
    it; `peak_memory`, MiB, of the trial that needed most; `devices`; and how many were
    `resumed`, of which only the last stretch is counted.
    """
    lines = []
    for figure in figures_of(study.preset):
        trials = grid(study.preset, figure, data=study.data, results=study.results)
        made = store.frame(trials)
        most, devices = (
            made.peak_memory.max() if len(made) else 0.0,
            tuple(sorted(set(made.device))),
        )
        lines.append(
            (
                figure,
                len(trials),
                len(made),
                made.seconds.sum() / 3600,
                most,
                devices,
                made.resumed.sum(),
            )
        )
    names = ["figure", "trials", "stored", "hours", "peak_memory", "devices", "resumed"]
    return pd.DataFrame(lines, columns=names)
