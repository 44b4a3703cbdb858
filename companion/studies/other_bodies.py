"""Pairs of robots that see or act differently: what SIDM saves for them.

The expert is the paper's expert of system 1. The novice is the same robot in the same
motion as the paper's novice, but has another body: other observations or actions. So
the expert's weights cannot all be copied.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.bodies import NOVICES
from companion.figures.style import METHOD_STYLES, legend_below
from companion.methods import ANY_BODIES
from companion.statistics.pairs import paired_comparison
from companion.study import Study
from companion.trials import Trial
from sidm.plots import finish, side_by_side, styled

#: Methods whose losses the figure compares with those of SIDM.
SHOWN = ("novice_only", "core_finetune")


def trials(study: Study, system: str) -> list[Trial]:
    """The methods that can learn from a pair of different bodies, for each novice."""
    preset, trials = study.preset, []
    for body in NOVICES.values():
        network = dataclasses.replace(preset.network, novice_body=body)  # type: ignore[type-var]
        novice = study.with_preset(dataclasses.replace(preset, network=network))  # type: ignore[type-var]
        sizes = preset.other_body_minutes
        trials += novice.points(system, ANY_BODIES, sizes, seeds=preset.seeds)
    return trials


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """Ratios of SIDM's losses to those of the other methods; below 1 SIDM is better.

    The table is made by `pairs.paired_comparison`, one row per novice, size and other
    method, which is in the column `against`.
    """
    point = ["system", "novice_body", "novice_minutes"]
    sidm, parts = frame[frame.method == "sidm"], []
    for other in ANY_BODIES:
        if other != "sidm":
            compared = paired_comparison(sidm, frame[frame.method == other], on=point)
            parts.append(compared.assign(against=other))
    return pd.concat(parts, ignore_index=True)


def by_novice(frame: pd.DataFrame) -> pd.DataFrame:
    """Results whose `system` is the novice's body: one system for each novice."""
    return frame.assign(system=frame.novice_body)


@styled
def figure(table: pd.DataFrame) -> Figure:
    """Ratio of the loss with SIDM to that of each method of SHOWN, a plot per size."""
    sizes = sorted(table.novice_minutes.unique())
    figure, panels = side_by_side(max(len(sizes), 1))
    names = list(NOVICES)
    if not sizes:
        finish(panels[0])
    for axes, minutes in zip(panels, sizes, strict=False):
        for number, other in enumerate(SHOWN):
            rows = table[(table.novice_minutes == minutes) & (table.against == other)]
            height = rows.novice_body.map(names.index) + 0.2 * (number - 0.5)
            bars = np.clip([rows.ratio - rows.low, rows.high - rows.ratio], 0, None)
            label = f"other: {METHOD_STYLES[other]['label']}"
            style = METHOD_STYLES[other] | {"linestyle": "", "label": label}
            style |= {"capsize": 2, "elinewidth": 1}
            axes.errorbar(rows.ratio, height, xerr=bars, **style)
        axes.axvline(1, color="0.5", lw=1, linestyle="-", marker="", zorder=0)
        axes.set_xlabel("loss with SIDM / loss of the other (-)")
        axes.set_title(f"{minutes:g} min of novice data")
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.5, -0.5)
        finish(axes, legend=False)
    legend_below(figure, panels)
    return figure
