"""What an SIDM saves along its training, as a figure: the decisive experiment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.style import legend_below, system_label
from companion.studies.decisive.along import MARKED
from companion.studies.decisive.verdicts import AT, END
from sidm.plots import finish, side_by_side, styled
from sidm.systems import PAPER_SYSTEMS

RECIPE_STYLES: dict[str, dict[str, Any]] = {
    "R": {"color": "#1A1A1A", "linestyle": "-"},
    "T": {"color": "#8C8C8C", "linestyle": "--"},
}
RECIPE_LABELS = {"R": "as released (R)", "T": "tuned (T)", "Q": "quick (Q)"}
RULE_MARKERS = dict(zip(MARKED, ("^", "s", "o"), strict=True))


@styled
def by_length(table: pd.DataFrame, systems: Sequence[str] = PAPER_SYSTEMS) -> Figure:
    """Data ratio and loss ratio at AT minutes against samples seen in training.

    A row of panels per system, a curve per recipe; shades are 95 % intervals, and the
    points are what stopping rules give.
    """
    figure, panels = side_by_side(2 * len(systems), 2)
    quantities = (
        ("data", "data without SIDM / with SIDM, same loss"),
        ("loss", "loss with SIDM / without SIDM"),
    )
    for row, system in enumerate(systems):
        for column, (quantity, ylabel) in enumerate(quantities):
            axes = panels[2 * row + column]
            axes.set(
                xscale="log",
                yscale="log",
                xlabel="samples seen by each (control steps)",
                ylabel=ylabel,
            )
            axes.set_title(f"{system_label(system)}, {AT:g} min of novice data")
            shown = table[
                (table.system == system)
                & (table.quantity == quantity)
                & (table.minutes == AT)
            ]
            for recipe, ratios in shown.groupby("recipe", sort=False):
                _draw(axes, ratios, str(recipe))
            axes.axhline(1, color="0.5", lw=1, linestyle="-", marker="", zorder=0)
            finish(axes, legend=False)
    legend_below(figure, panels)
    return figure


def _draw(axes: Axes, ratios: pd.DataFrame, recipe: str) -> None:
    """Draw the curve of a recipe, its interval and the points of stopping rules."""
    style = RECIPE_STYLES[recipe]
    curve = ratios[ratios.rule == ""].sort_values("samples")
    axes.plot(
        curve.samples, curve.value, **style, marker="", label=RECIPE_LABELS[recipe]
    )
    axes.fill_between(
        curve.samples,
        curve.low,
        curve.high.replace(np.inf, np.nan),
        color=style["color"],
        alpha=0.15,
        lw=0,
    )
    marked = ratios[ratios.rule.isin(MARKED)]
    for rule, point in marked.set_index("rule").iterrows():
        label = f"{recipe}: {'' if rule == END else 'rule '}{rule}"
        reach = np.abs([[point.value - point.low], [point.high - point.value]])
        axes.errorbar(
            [point.samples],
            [point.value],
            yerr=reach if np.isfinite(reach).all() else None,
            color=style["color"],
            linestyle="",
            marker=RULE_MARKERS[str(rule)],
            capsize=2,
            label=label,
        )
