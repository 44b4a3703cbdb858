"""Results as curves, each a Matplotlib Figure in the book's style.

Figures are safe for colour-blind readers and opaque, with units on every axis.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.style import (
    EFFICIENCY_MARKS,
    LOSS_BY_SIZE,
    METHOD_STYLES,
    legend_below,
    legend_entries,
    mean_and_range,
    system_panels,
)
from companion.methods import FIGURE3
from companion.statistics.efficiency import efficiency, isotonic_fit
from companion.statistics.pairs import complete, unique_results
from companion.statistics.savings import efficiency_band
from sidm.plots import finish, styled
from sidm.systems import PAPER_SYSTEMS

MOST_INSIDE = 4  # number of methods whose names have room inside a plot


@styled
def figure3(
    frame: pd.DataFrame,
    systems: Sequence[str] = PAPER_SYSTEMS,
    methods: Sequence[str] = FIGURE3,
) -> Figure:
    """Figure 3: validation loss against novice data.

    Lines are means over the seeds of each size; shades reach from minimum to maximum. A
    dotted level marks the method `expert_only`, which has no novice data, where its
    results are in `frame`. The names of more than MOST_INSIDE methods stand below the
    plots.
    """
    figure, plots = system_panels(frame, systems, **LOSS_BY_SIZE)
    crowded = len(methods) > MOST_INSIDE
    for system, (axes, rows) in zip(systems, plots, strict=True):
        sizes = _curves(axes, rows, system, methods)
        expert_only = rows[rows.method == "expert_only"].validation_loss
        if len(expert_only):
            style = METHOD_STYLES["expert_only"] | {"marker": "", "linestyle": ":"}
            axes.axhline(expert_only.mean(), **style)
            shade = {"color": style["color"], "alpha": 0.12, "lw": 0}
            axes.axhspan(expert_only.min(), expert_only.max(), **shade)
        finish(axes, sizes, legend=not crowded)
    if crowded:
        legend_below(figure, figure.axes)
    return figure


def _curves(
    axes: Axes, frame: pd.DataFrame, system: str, methods: Sequence[str]
) -> set[float]:
    """Draw the curves of Figure 3 for some methods.

    Args:
        axes: to draw on.
        frame: results.
        system: of these results.
        methods: of these results.

    Returns:
        The sizes of the novice data, min.
    """
    drawn: set[float] = set()
    for method in methods:
        rows = unique_results(frame, system, [method])
        if len(rows):
            minutes = rows.novice_minutes.astype(float)
            by_size = rows.validation_loss.astype(float).groupby(minutes)
            losses = by_size.agg(["mean", "min", "max"])
            mean_and_range(axes, losses, **METHOD_STYLES[method])
            drawn |= set(losses.index)
    return drawn


@styled
def efficiency_curves(
    frame: pd.DataFrame, systems: Sequence[str] = PAPER_SYSTEMS
) -> Figure:
    """Data-efficiency ratio against the loss to be reached.

    The 95 % interval is shaded; triangles mark bounds.
    """
    xlabel = "validation loss to reach\n(squared m, m/s and rad/s, summed)"
    ylabel = "data without SIDM / data with SIDM (-)"
    figure, plots = system_panels(
        frame, systems, yscale="log", xlabel=xlabel, ylabel=ylabel
    )
    for system, (axes, rows) in zip(systems, plots, strict=True):
        losses = complete(rows, system)
        if losses.values.size:
            sidm, novice = losses.values.mean(0)
            fits = np.concatenate([isotonic_fit(sidm), isotonic_fit(novice)])
            levels = np.linspace(fits.min(), fits.max(), 60)
            curve = efficiency(losses.minutes, sidm, novice, levels)
            band = efficiency_band(losses.minutes, losses.values, curve.loss)
            axes.fill_between(curve.loss, *band, color="0.5", alpha=0.2, lw=0)
            for bound, marker, colour, label in EFFICIENCY_MARKS:
                where = curve.bound == bound
                if where.any():
                    points = curve.loss[where], curve.ratio[where]
                    axes.plot(*points, marker, color=colour, label=label)
            axes.axhline(1, color="0.5", lw=1, linestyle="-", marker="")
        finish(axes)
    return figure


def by_method_and_size(
    frame: pd.DataFrame,
) -> Iterator[tuple[str, float, pd.DataFrame]]:
    """Yield method, size and results of each group, sorted in descending order."""
    groups = list(frame.groupby(["method", "novice_minutes"]))
    for (method, minutes), group in reversed(groups):
        yield str(method), float(minutes), group


def size_style(method: str, index: int) -> dict[str, Any]:
    """Line style of a method and a size: the method's colour, dashes by `index`."""
    line = ("-", "--", "-.", ":", (0, (5, 1, 1, 1)), (0, (1, 3)))[index % 6]
    return {"color": METHOD_STYLES[method]["color"], "linestyle": line, "marker": ""}


@styled
def learning_curves(
    frame: pd.DataFrame, systems: Sequence[str] = PAPER_SYSTEMS
) -> Figure:
    """Novice test loss against samples seen, one thin line per trial."""
    xlabel = "samples seen (control steps)"
    ylabel = "novice test loss, equation (1)\n(raw units squared)"
    scales = {"xscale": "log", "yscale": "log"}
    figure, plots = system_panels(
        frame, systems, xlabel=xlabel, ylabel=ylabel, **scales
    )
    for axes, results in plots:
        sizes = sorted(results.novice_minutes.unique())
        for method, minutes, group in by_method_and_size(results):
            style = size_style(method, sizes.index(minutes)) | {"lw": 0.9}
            label: str | None = f"{METHOD_STYLES[method]['label']}, {minutes:g} min"
            for row in group.itertuples():
                axes.plot(row.curve_samples, row.curve_test_loss, label=label, **style)
                label = None  # one entry of the legend per group
        finish(axes, legend=False)
    if drawn := legend_entries(figure.axes):
        figure.legend(drawn.values(), drawn.keys(), loc="outside right upper")
    return figure
