"""Several ablations on one page: their trials, what is stored of them, commands."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.engine.store import Results
from companion.pages.markdown import known_text
from companion.pages.page import Page
from companion.registry import grid
from companion.studies import ablations
from companion.studies.decisive import ablated
from companion.study import Study
from companion.trials import Trial
from ownrobot.comparison.statistics import Interval

#: Ablated setting -> the figure whose grid has its trials; others have ITERATIONS.
GRIDS = {"p_expert": "p-expert", "pixels": "pixels", "patience": "patience"}
ITERATIONS = "iterations"
#: Number of the text -> setting of recipe R that is changed, its value, pair of robots.
RELEASED = {
    "released-low": ("p_expert", 0.25, "system1"),
    "released-large": ("p_expert", 0.9, "system1"),
    "released-middle-2": ("p_expert", 0.75, "system2"),
    "released-large-2": ("p_expert", 0.9, "system2"),
    "released-matching": ("matching_iterations", 100, "system1"),
}


class Ablations:
    """Ablations by the name of their setting, each with Figure 3's value.

    `values` are those of each setting, as in `ablations.with_usual`; sizes are those of
    the preset's ablations by default.
    """

    def __init__(
        self,
        study: Study,
        store: Results,
        systems: Sequence[str],
        values: Mapping[str, Sequence[Any]],
        sizes: Sequence[float] = (),
    ) -> None:
        self.study, self.store, self.systems = study, store, systems
        self.sizes = sorted(sizes or study.preset.ablation_minutes)
        self._trials = {
            name: [
                trial
                for system in systems
                for trial in ablations.with_usual(study, system, name, tried, sizes)
            ]
            for name, tried in values.items()
        }
        #: setting -> pair of robots -> Figure 3's value
        self.usual = {
            name: {
                system: float(ablations.usual(study.preset, system, name))
                for system in systems
            }
            for name in values
        }

    def trials(self, *names: str) -> list[Trial]:
        """The trials of some settings, all by default, each once."""
        chosen = (trial for name in names or self.usual for trial in self._trials[name])
        return list({trial.key: trial for trial in chosen}.values())

    def frame(self, *names: str) -> pd.DataFrame:
        """The stored results of `trials`."""
        return self.store.frame(self.trials(*names))

    @functools.cached_property
    def tables(self) -> dict[str, pd.DataFrame]:
        """Setting -> `ablations.table` of its stored results."""
        return {
            name: ablations.table(self.frame(name), name, name in ablations.OF_BOTH)
            for name in self.usual
        }

    @functools.cached_property
    def ratios(self) -> dict[str, pd.DataFrame]:
        """Setting -> `ablations.ratios` of its stored results."""
        return {
            name: ablations.ratios(self.frame(name), name, usual, self.store.folder)
            for name, usual in self.usual.items()
        }

    def dots(self, names: Sequence[str], minutes: float) -> pd.DataFrame:
        """Ratios of settings at a size, a row per `system`, `setting` and `value`.

        Figure 3's values have the ratio 1 and no interval.
        """
        parts = []
        for name in names:
            rows = self.ratios[name]
            rows = rows[rows.novice_minutes == minutes]
            usual = {s: v for s, v in self.usual[name].items() if s in set(rows.system)}
            own = pd.DataFrame({"system": [*usual], "value": [*usual.values()]})
            both = pd.concat([rows, own.assign(ratio=1.0)])
            parts.append(both.assign(setting=name))
        return pd.concat(parts)

    def ratio(self, name: str, system: str, value: float) -> str:
        """The SIDM's loss at a value by that at Figure 3's, at the smallest size."""
        rows = self.ratios[name]
        rows = rows[(rows.system == system) & (rows.value == value)]
        rows = rows[rows.novice_minutes == min(self.sizes)]
        return ratio_text(rows[rows.method == "sidm"] if "method" in rows else rows)

    def figure(self, *names: str) -> Figure:
        """Losses by the values of some settings, side by side."""
        tables = {name: self.tables[name] for name in names}
        return ablations.figure(tables, self.systems, self.usual)

    def page_tables(self) -> Iterator[tuple[str, pd.DataFrame]]:
        """Title and table of each setting and size, for a page."""
        for name, table in self.tables.items():
            label = name.replace("_", " ").capitalize()
            label = "$p_e$" if name == "p_expert" else label
            for size in self.sizes:
                rows = table[table.novice_minutes == size]
                title = f"{label}, {size:g} min of novice data"
                yield title, ablations.page_table(rows, self.ratios[name])

    def commands(self, page: Page, *names: str) -> list[str]:
        """The commands that run `trials`: of their figures, or else of the page."""
        figures = dict.fromkeys(GRIDS.get(n, ITERATIONS) for n in names or self.usual)
        known = {
            trial.key for figure in figures for trial in grid(self.study.preset, figure)
        }
        if {trial.key for trial in self.trials(*names)} <= known:
            return [page.again(figure) for figure in figures]
        return [page.command(run_missing=True)]


def released_numbers(
    ratios: pd.DataFrame, learnt: pd.DataFrame, phases: pd.DataFrame
) -> Iterator[tuple[str, str]]:
    """Numbers of recipe R by name; 'not run' where trainings lack.

    `ratios` are rows of `ablated.table` of one rule, `learnt` is
    `ablated.training_ratios`, and `phases` is `ablated.phase_losses`.
    """
    for name, where in RELEASED.items():
        yield name, ratio_text(_at(ratios, *where))
    for name, system in (("harmed", "system1"), ("harmed-2", "system2")):
        rows = _at(learnt, "matching_iterations", 100, system)
        yield name, ratio_text(rows)
    matching = phases[phases.system == "system1"].set_index("iterations").matching
    for name, iterations in (("matched-own", 100), ("matched-long", 500)):
        value = matching.get(f"{iterations} prediction, 20 matching", np.nan)
        yield name, known_text("{:.2f}", value)


def _at(table: pd.DataFrame, setting: str, value: float, system: str) -> pd.DataFrame:
    return ablated.changed_to(table, setting, value).query("system == @system")


def ratio_text(rows: pd.DataFrame) -> str:
    """The ratio in the first row of a comparison, or that none was run."""
    if rows.empty:
        return "not run"
    return Interval(*rows[["ratio", "low", "high"]].iloc[0]).text(2)
