"""The grids of trials, by the figure that they are for, and their cost."""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from companion.presets import Preset
from companion.study import Study
from companion.trials import Trial
from sidm.config import ConfigError, unknown_name
from sidm.systems import FAMILY_PAIRS, FREE_SYSTEMS, PAPER_SYSTEMS, SYSTEMS, find_system


class Figure(NamedTuple):
    """A figure: what makes its trials, and its pairs of robots.

    The module of a study is imported when its trials are listed.
    """

    name: str  # of a method of Study, or of a study's module and function
    pairs: tuple[str, ...] = tuple(SYSTEMS)

    def trials(self, study: Study, pair: str) -> list[Trial]:
        """The trials of one pair of robots."""
        if "." not in self.name:
            return getattr(study, self.name)(pair)
        return pkgutil.resolve_name(f"companion.studies.{self.name}")(study, pair)


#: The figures by name.
FIGURES = {
    "decisive": Figure("decisive.design.trials", (*PAPER_SYSTEMS, *FREE_SYSTEMS)),
    "duration": Figure("duration.trials", ("system1",)),
    "3": Figure("figure3"),
    "references": Figure("references"),
    "4": Figure("figure4", ("system1",)),
    "tuning": Figure("tuning.trials"),
    "little-data": Figure("tuning.little_data"),
    "choices": Figure("choices.trials"),
    "released": Figure("choices.released"),
    "baselines": Figure("baselines.trials"),
    "variants": Figure("variants.trials"),
    "p-expert": Figure("ablations.p_expert"),
    "iterations": Figure("ablations.phases"),
    "pixels": Figure("ablations.pixels"),
    "patience": Figure("ablations.patience"),
    "other-bodies": Figure("other_bodies.trials", ("system1",)),
    "free-struts": Figure("free_struts", tuple(FREE_SYSTEMS)),
    "network-size": Figure("network_size.trials", ("system1",)),
    "corrected-claim": Figure("corrected_claim.trials", (*FREE_SYSTEMS, *FAMILY_PAIRS)),
    "most-data": Figure("ablations.most_data_trials"),
}

#: Figures that only those presets have that name them.
OPT_IN = (
    "decisive",
    "duration",
    "little-data",
    "free-struts",
    "network-size",
    "corrected-claim",
)

#: Former names of figures -> today's names.
FORMER = {"yardsticks": "references", "ample": "most-data"}


def find_figure(name: str) -> Figure | None:
    """The figure of a name: of FIGURES, or of a module of `studies` with `trials`.

    The module of a figure 'my-study' is `studies/my_study.py`; it is about all pairs.
    """
    if name in FIGURES:
        return FIGURES[name]
    module = f"companion.studies.{name.replace('-', '_')}"
    plain = name.replace("-", "").isalnum()
    if not plain or importlib.util.find_spec(module) is None:
        return None
    has_trials = hasattr(importlib.import_module(module), "trials")
    return Figure(f"{name.replace('-', '_')}.trials") if has_trials else None


def figures_of(preset: Preset) -> tuple[str, ...]:
    """Names of a preset's figures, keys of FIGURES."""
    return preset.figures or tuple(name for name in FIGURES if name not in OPT_IN)


def grid(
    preset: Preset | str,
    figure: str = "3",
    system: str | None = None,
    minutes: Sequence[float] | None = None,
    seeds: Sequence[int] | None = None,
    data: str | Path = "data",
    results: str | Path = "results",
    steps: Sequence[str] | None = None,
) -> list[Trial]:
    """The trials of a figure, each once.

    Args:
        preset: a Preset or the name of one.
        figure: a name that `find_figure` knows, or 'all' for all figures of the preset.
        system: only trials of this system.
        minutes: only trials with these novice dataset sizes.
        seeds: only trials with these seeds.
        data: folder of the data.
        results: folder of the results.
        steps: only trials of these steps of the figure 'decisive'.

    Raises:
        ConfigError: a name does not exist, or the figure does not have a system, a
            size, a seed or steps.
    """
    if figure in FORMER:
        raise ConfigError(f"figure '{figure}' is called '{FORMER[figure]}' now")
    if figure != "all" and find_figure(figure) is None:
        raise unknown_name(figure, (*FIGURES, "all"), kind="figure")
    if system is not None:
        find_system(system)
    study = Study(preset, data, results)
    by_key: dict[str, Trial] = {}
    names = figures_of(study.preset) if figure == "all" else (figure,)
    found = [one for one in map(find_figure, names) if one is not None]
    for one in found:
        for pair in one.pairs:
            if system in (None, pair):
                made = one.trials(study, pair)
                by_key |= {trial.key: trial for trial in made}
    trials = list(by_key.values())
    if figure == "decisive":  # its steps go across systems
        in_order = pkgutil.resolve_name("companion.studies.decisive.design.in_order")
        trials = in_order(trials, study, steps)
    elif steps is not None:
        raise ConfigError(f"the figure decisive alone has steps, not {figure}")
    if not trials:
        known = dict.fromkeys(pair for one in found for pair in one.pairs)
        raise ConfigError(
            f"figure {figure} has no trials of {system}, only of {', '.join(known)}"
        )
    trials = _with_values(trials, "minutes", "novice_minutes", minutes)
    return _with_values(trials, "seeds", "seed", seeds)


def _with_values(
    trials: list[Trial], name: str, field: str, values: Sequence[float] | None
) -> list[Trial]:
    """The trials whose `field` has one of the `values`; all trials for None."""
    if values is None:
        return trials
    known = sorted({getattr(trial, field) for trial in trials})
    for value in values:
        if value not in known:
            listed = ", ".join(f"{number:g}" for number in known)
            raise ConfigError(f"{name} {value:g} is not in this grid; it has {listed}")
    return [trial for trial in trials if getattr(trial, field) in values]
