"""Figures of the decisive experiment, all about the length of training.

They show the loss along the training, what an SIDM saves along it, and Figure 3 by each
stopping rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.style import (
    LOSS_BY_SIZE,
    METHOD_STYLES,
    legend_below,
    mean_and_range,
    system_label,
)
from companion.statistics.stopping_rules import RULES, stored_curve
from companion.studies.decisive.along import MARKED
from companion.studies.decisive.verdicts import AT, END, losses_by
from sidm.plots import finish, side_by_side, styled
from sidm.systems import PAPER_SYSTEMS

RECIPE_STYLES: dict[str, dict[str, Any]] = {
    "R": {"color": "#0072B2", "linestyle": "-"},
    "T": {"color": "#D55E00", "linestyle": "--"},
}
RECIPE_LABELS = {"R": "as released (R)", "T": "each at its best (T)"}
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
        label = f"{recipe}: {'' if rule == END else 'by the rule of '}{rule}"
        reach = np.abs([[point.value - point.low], [point.high - point.value]])
        axes.errorbar(
            [point.samples],
            [point.value],
            yerr=reach if np.isfinite(reach).all() else None,
            color=style["color"],
            linestyle="",
            marker=RULE_MARKERS[str(rule)],
            capsize=2,
            label=label.replace("'s", ""),
        )


@styled
def losses_along(frame: pd.DataFrame) -> Figure:
    """Validation loss with AT minutes against samples seen: a panel per arm.

    An arm is a recipe on a system that has SIDMs. Lines are means over seeds, shades
    reach from minimum to maximum.
    """
    few = frame[frame.novice_minutes == AT]
    arms = [
        (recipe, system, arm)
        for (system, recipe), arm in few.groupby(["system", "recipe"])
        if (arm.method == "sidm").any()
    ]
    figure, panels = side_by_side(max(len(arms), 2), 2)
    for axes in panels[max(len(arms), 1) :]:
        axes.set_axis_off()
    if not arms:
        finish(panels[0])
    for axes, (recipe, system, arm) in zip(panels, arms, strict=False):
        axes.set(xscale="log", yscale="log", xlabel="samples seen (control steps)")
        axes.set(ylabel="validation loss")
        axes.set_title(f"{system_label(system)}, {RECIPE_LABELS[recipe]}")
        for method, group in arm.groupby("method", sort=False):
            curves = [stored_curve(row) for _, row in group.iterrows()]
            shortest = min(len(curve.samples) for curve in curves)
            losses = np.array([curve.validation_loss[:shortest] for curve in curves])
            table = pd.DataFrame(
                {
                    "mean": losses.mean(0),
                    "min": losses.min(0),
                    "max": losses.max(0),
                },
                index=curves[0].samples[:shortest],
            )
            mean_and_range(axes, table, **METHOD_STYLES[str(method)] | {"marker": ""})
        finish(axes, legend=False)
    legend_below(figure, panels[: len(arms)])
    return figure


@styled
def by_rule(frame: pd.DataFrame, recipe: str, system: str) -> Figure:
    """Figure 3 of a recipe on a system, a panel per stopping rule.

    Curves are means over seeds, shades reach from minimum to maximum.
    """
    chosen = frame[(frame.recipe == recipe) & (frame.system == system)]
    figure, panels = side_by_side(len(RULES), 2)
    for axes, rule in zip(panels, RULES, strict=True):
        axes.set(title=rule.replace("'s", "'s rule"), **LOSS_BY_SIZE)
        for method, group in losses_by(chosen, rule).groupby("method", sort=False):
            losses = group.groupby("novice_minutes").loss.agg(["mean", "min", "max"])
            mean_and_range(axes, losses, **METHOD_STYLES[str(method)])
        finish(axes, sorted(set(chosen.novice_minutes)), legend=False)
    ends = [end for axes in panels if axes.has_data() for end in axes.get_ylim()]
    for axes in panels:
        axes.set_ylim(min(ends, default=None), max(ends, default=None))
    legend_below(figure, panels)
    return figure
