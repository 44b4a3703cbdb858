"""What an SIDM saves against how long it and its rival are trained, and Figure 3 by each stopping rule."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.figures.style import (
    LOSS_BY_SIZE,
    METHOD_STYLES,
    legend_below,
    mean_and_range,
    named,
)
from companion.statistics.stopping_rules import RULES, kept_by
from companion.studies.decisive.verdicts import (
    AT,
    END,
    RELEASED,
    loss_ratio,
    losses_by,
    ratio_of_data,
)
from sidm.learning.stopping import Rule
from sidm.plots import finish, side_by_side, styled
from sidm.systems import SYSTEMS

SIZES = (1.0, 5.0, 20.0)  # min at which losses are compared along the training
LENGTHS = tuple(
    int(samples) for samples in np.geomspace(100_000, 8_000_000, 25).round(-3)
)
MARKED = ("this book's", RELEASED, END)  # rules that have a point on the lines
RECIPE_STYLES = {
    "R": {"color": "#0072B2", "linestyle": "-"},
    "T": {"color": "#D55E00", "linestyle": "--"},
}
RECIPE_LABELS = {"R": "as released (R)", "T": "each as well as we can (T)"}
RULE_MARKERS = dict(zip(MARKED, ("^", "s", "o"), strict=True))


def lengths_of(frame: pd.DataFrame) -> list[int]:
    """LENGTHS at which all trainings of some results have been tested, and some still go on."""
    if not len(frame):
        return []
    return [
        samples
        for samples in LENGTHS
        if frame.test_spacing.max() <= samples <= frame.max_samples.max()
    ]


def along(frame: pd.DataFrame) -> pd.DataFrame:
    """What an SIDM saves, had all trainings been stopped after so many samples, or by a rule.

    Args:
        frame: of `verdicts.results`.

    Returns:
        A line a `recipe`, `system`, `quantity` ('data' or 'loss'), `minutes` of the
        SIDM, and `rule`, which is empty where all were stopped after `samples`; those
        of a rule are the median over the SIDM's trainings. `value`, `low` and `high`
        are the data ratio at AT minutes, or the ratio of the losses with and without
        SIDM.
    """
    lines: list[tuple] = []
    for (recipe, system), mine in frame.groupby(["recipe", "system"], sort=False):
        stopped = [
            (samples, "", kept_losses(mine, Rule(most=samples)))
            for samples in lengths_of(mine)
        ]
        for rule in MARKED:
            sidm = kept_by(
                mine[(mine.method == "sidm") & (mine.novice_minutes == AT)], RULES[rule]
            )
            if len(sidm):
                stopped.append((int(sidm.seen.median()), rule, losses_by(mine, rule)))
        for samples, rule, own in stopped:
            lines.append(
                (recipe, system, "data", AT, rule, samples, *ratio_of_data(own, "sidm"))
            )
            lines += [
                (recipe, system, "loss", size, rule, samples, *loss_ratio(own, size))
                for size in SIZES
            ]
    names = [
        "recipe",
        "system",
        "quantity",
        "minutes",
        "rule",
        "samples",
        "seeds",
        "value",
        "low",
        "high",
    ]
    return pd.DataFrame(lines, columns=names)


def kept_losses(frame: pd.DataFrame, rule: Rule) -> pd.DataFrame:
    """Results with the validation `loss` that a rule keeps, on the motion that every test has."""
    found = kept_by(frame, rule)
    return found.assign(loss=found.kept_validation)


@styled
def by_length(table: pd.DataFrame, systems: Sequence[str] = tuple(SYSTEMS)) -> Figure:
    """Data ratio and loss ratio at AT minutes against samples seen: a column a system, a line a recipe.

    Shades are 95 % intervals; the points are what stopping rules give.
    """
    figure, panels = side_by_side(2 * len(systems), len(systems))
    rows = (
        ("data", "data without SIDM / with SIDM, same loss"),
        ("loss", "loss with SIDM / without SIDM"),
    )
    for row, (quantity, words) in enumerate(rows):
        for column, system in enumerate(systems):
            axes = panels[row * len(systems) + column]
            axes.set(
                xscale="log",
                yscale="log",
                xlabel="samples seen by each (control steps)",
                ylabel=words,
            )
            axes.set_title(f"{named(system)}, {AT:g} min of novice data")
            own = table[
                (table.system == system)
                & (table.quantity == quantity)
                & (table.minutes == AT)
            ]
            for recipe, some in own.groupby("recipe", sort=False):
                _draw(axes, some, str(recipe))
            axes.axhline(1, color="0.5", lw=1, linestyle="-", marker="", zorder=0)
            finish(axes, legend=False)
    legend_below(figure, panels)
    return figure


def _draw(axes, some: pd.DataFrame, recipe: str) -> None:
    """Draw the line of a recipe, its interval, and the points of the stopping rules."""
    style, line = RECIPE_STYLES[recipe], some[some.rule == ""].sort_values("samples")
    axes.plot(line.samples, line.value, **style, marker="", label=RECIPE_LABELS[recipe])
    axes.fill_between(
        line.samples,
        line.low,
        line.high.replace(np.inf, np.nan),
        color=style["color"],
        alpha=0.15,
        lw=0,
    )
    for rule, point in some[some.rule != ""].set_index("rule").iterrows():
        label = f"{recipe}: {'' if rule == END else 'by the rule of '}{rule}"
        off = np.abs([[point.value - point.low], [point.high - point.value]])
        axes.errorbar(
            [point.samples],
            [point.value],
            yerr=off if np.isfinite(off).all() else None,
            color=style["color"],
            linestyle="",
            marker=RULE_MARKERS[str(rule)],
            capsize=2,
            label=label.replace("'s", ""),
        )


@styled
def by_rule(frame: pd.DataFrame, recipe: str, system: str) -> Figure:
    """Figure 3 of a recipe on a system by each stopping rule: means over seeds, shades minimum to maximum."""
    mine = frame[(frame.recipe == recipe) & (frame.system == system)]
    figure, panels = side_by_side(len(RULES), 2)
    for axes, rule in zip(panels, RULES, strict=True):
        axes.set(title=rule.replace("'s", "'s rule"), **LOSS_BY_SIZE)
        for method, own in losses_by(mine, rule).groupby("method", sort=False):
            losses = own.groupby("novice_minutes").loss.agg(["mean", "min", "max"])
            mean_and_range(axes, losses, **METHOD_STYLES[str(method)])
        finish(axes, sorted(set(mine.novice_minutes)), legend=False)
    ends = [end for axes in panels if axes.has_data() for end in axes.get_ylim()]
    for axes in panels:
        axes.set_ylim(min(ends, default=None), max(ends, default=None))
    legend_below(figure, panels)
    return figure
