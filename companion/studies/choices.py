"""The worth of choices that the paper leaves open or the released code makes otherwise.

Figure 3's methods, as each was tuned, are trained with one choice changed at a time, on
the smallest dataset of the ablations; and with the released code's choices together, at
every size.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.engine.store import Results
from companion.figures.dots import dot_plots, line_of_no_difference, name_rows
from companion.figures.style import METHOD_STYLES, legend_below
from companion.methods import CHOICES, COMPARED, FIGURE3, RELEASED
from companion.statistics import savings
from companion.statistics.pairs import paired_comparison
from companion.studies.reproduction import with_repeats
from companion.study import Study
from companion.trials import Trial
from ownrobot.plots import finish, styled

#: Description of a choice -> changes of the preset, and the methods that it concerns.
Choices = Mapping[str, tuple[dict[str, Any], tuple[str, ...]]]

UNCHANGED = "as in Figure 3"


def changed(
    study: Study, system: str, choices: Choices = CHOICES
) -> dict[str, list[Trial]]:
    """The trials of a system with each of the choices changed, by the choice.

    Those of CHOICES are on a small dataset, those of RELEASED at every size.
    """
    small = study.preset.ablation_minutes[:1]
    every = study.preset.novice_minutes(system)
    return {
        choice: study.changed(**changes).points(
            system, methods, small if choice in CHOICES else every
        )
        for choice, (changes, methods) in choices.items()
    }


def trials(study: Study, system: str) -> list[Trial]:
    """Figure 3's methods on a small dataset with one choice changed at a time."""
    return sum(changed(study, system).values(), [])


def released(study: Study, system: str) -> list[Trial]:
    """Figure 3 with choices of the released code made together."""
    return sum(changed(study, system, RELEASED).values(), [])


def frame(
    study: Study, store: Results, systems: Iterable[str], choices: Choices = CHOICES
) -> pd.DataFrame:
    """Stored results by `choice`; the results of Figure 3 have the choice UNCHANGED."""
    parts = []
    for system in systems:
        figure3 = study.points(system, FIGURE3, study.preset.novice_minutes(system))
        grids = {UNCHANGED: figure3} | changed(study, system, choices)
        parts += [
            store.frame(trials, curves=True).assign(choice=choice)
            for choice, trials in grids.items()
        ]
    return pd.concat(parts)


def table(frame: pd.DataFrame, results: str | Path) -> pd.DataFrame:
    """Ratios of the losses with a choice changed to the losses of Figure 3.

    Repeated trials of Figure 3 in `results` stand in where the changed ones ran on
    motion that was simulated again. The table is made by `pairs.paired_comparison`, one
    row per system, method, size and choice; a ratio above 1 means that the choice of
    Figure 3 is better.
    """
    return paired_comparison(
        frame[frame.choice != UNCHANGED],
        with_repeats(frame[frame.choice == UNCHANGED], results),
        ["system", "method", "novice_minutes"],
        ["choice"],
    )


def saved(frame: pd.DataFrame) -> pd.DataFrame:
    """Data ratios of the SIDM in Figure 3 and with choices of the released code.

    Where only the SIDM has a choice, the novice alone is that of Figure 3. `frame` is
    made by `frame` with RELEASED; the table is one of `savings.savings` with the column
    `choice`.
    """
    parts = []
    for choice, rows in frame.groupby("choice", sort=False):
        alone = frame[(frame.choice == UNCHANGED) & (frame.method == COMPARED[1])]
        both = rows if COMPARED[1] in set(rows.method) else pd.concat([rows, alone])
        parts.append(savings.savings(both).assign(choice=choice))
    return pd.concat(parts) if parts else savings.savings(frame).assign(choice="")


@styled
def figure(table: pd.DataFrame) -> Figure:
    """A row per choice with the ratio of each method's losses and its interval.

    `table` has rows of `table` of one system and size.
    """
    names = list(dict.fromkeys(table.choice))
    drawn, (axes,) = dot_plots(1, len(names), height=0.55)
    methods = [name for name in FIGURE3 if name in set(table.method)]
    for number, method in enumerate(methods):
        rows = table[table.method == method]
        heights = rows.choice.map(names.index) + 0.19 * number - 0.05
        bars = np.clip([rows.ratio - rows.low, rows.high - rows.ratio], 0, None)
        style = METHOD_STYLES[method] | {"linestyle": "", "elinewidth": 1.2}
        axes.errorbar(rows.ratio, heights, xerr=bars, capsize=2, **style)
    if names:
        line_of_no_difference(axes)
        axes.set(xscale="log", xlabel="loss after the change / loss before it")
    finish(axes, [0.9, 1, 1.1, 1.2, 1.3, 1.4] if names else (), legend=False)
    if names:
        name_rows(axes, names)
    legend_below(drawn, [axes])
    return drawn
