"""Results as figures, each a matplotlib Figure in the book's style: colour-blind safe, opaque, units on every axis."""

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
    by_system,
    labelled,
    legend_below,
    mean_and_range,
)
from companion.methods import COMPARED, FIGURE3
from companion.statistics.efficiency import efficiency, falling
from companion.statistics.pairs import complete, of_one_grid
from companion.statistics.savings import efficiency_band
from sidm.plots import finish, styled
from sidm.systems import SYSTEMS

MOST_INSIDE = 4  # methods whose names have room within a plot


@styled
def figure3(
    frame: pd.DataFrame,
    systems: Sequence[str] = tuple(SYSTEMS),
    methods: Sequence[str] = FIGURE3,
) -> Figure:
    """Figure 3: validation loss against novice data; lines are means over each size's seeds, shades minimum to maximum.

    A dotted level marks the method `expert_only` where its results are there: it has no
    novice data. The names of more than MOST_INSIDE methods stand below the plots.
    """
    figure, plots = by_system(frame, systems, **LOSS_BY_SIZE)
    crowded = len(methods) > MOST_INSIDE
    for system, (axes, mine) in zip(systems, plots, strict=True):
        drawn = _curves(axes, mine, system, methods)
        alone = mine[mine.method == "expert_only"].validation_loss
        if len(alone):
            style = METHOD_STYLES["expert_only"] | {"marker": "", "linestyle": ":"}
            axes.axhline(alone.mean(), **style)
            axes.axhspan(
                alone.min(), alone.max(), color=style["color"], alpha=0.12, lw=0
            )
        finish(axes, drawn, legend=not crowded)
    if crowded:
        legend_below(figure, figure.axes)
    return figure


def _curves(
    axes: Axes,
    frame: pd.DataFrame,
    system: str,
    methods: Sequence[str],
    words: str = "",
    **other: Any,
) -> set[float]:
    """Figure 3's curves of some methods, and the sizes that they have; `words` after the labels, `other` styles."""
    drawn: set[float] = set()
    for method in methods:
        found = of_one_grid(frame, system, [method])
        if len(found):
            style = METHOD_STYLES[method] | other
            one = ", one seed" if words and found.seed.nunique() == 1 else ""
            sizes = found.validation_loss.astype(float).groupby(
                found.novice_minutes.astype(float)
            )
            losses = sizes.agg(["mean", "min", "max"])
            mean_and_range(
                axes, losses, **style | {"label": style["label"] + words + one}
            )
            drawn |= set(losses.index)
    return drawn


@styled
def changed_choices(
    frame: pd.DataFrame,
    changed: pd.DataFrame,
    words: str,
    systems: Sequence[str] = tuple(SYSTEMS),
) -> Figure:
    """Figure 3's curves of the paper's methods, beside those with a choice changed with hollow marks and `words`."""
    figure, plots = by_system(frame, systems, **LOSS_BY_SIZE)
    for system, (axes, mine) in zip(systems, plots, strict=True):
        drawn = _curves(axes, mine, system, COMPARED)
        drawn |= _curves(
            axes,
            changed,
            system,
            COMPARED,
            words=f", {words}",
            mfc="white",
            linewidth=1,
        )
        finish(axes, drawn)
    return figure


@styled
def efficiency_curves(frame: pd.DataFrame) -> Figure:
    """Data-efficiency ratio against the loss to be reached, its 95 % interval shaded; triangles mark bounds."""
    xlabel = "validation loss to reach\n(squared m, m/s and rad/s, summed)"
    ylabel = "data without SIDM / data with SIDM (-)"
    figure, plots = by_system(
        frame, tuple(SYSTEMS), yscale="log", xlabel=xlabel, ylabel=ylabel
    )
    for system, (axes, mine) in zip(SYSTEMS, plots, strict=True):
        losses = complete(mine, system)
        if losses.values.size:
            sidm, novice = losses.values.mean(0)
            reach = np.concatenate([falling(sidm), falling(novice)])
            found = efficiency(
                losses.minutes, sidm, novice, np.linspace(reach.min(), reach.max(), 60)
            )
            band = efficiency_band(losses.minutes, losses.values, found.loss)
            axes.fill_between(found.loss, *band, color="0.5", alpha=0.2, lw=0)
            for bound, marker, colour, words in EFFICIENCY_MARKS:
                at = found.bound == bound
                if at.any():
                    axes.plot(
                        found.loss[at],
                        found.ratio[at],
                        marker,
                        color=colour,
                        label=words,
                    )
            axes.axhline(1, color="0.5", lw=1, linestyle="-", marker="")
        finish(axes)
    return figure


def by_method_and_size(
    frame: pd.DataFrame,
) -> Iterator[tuple[str, float, pd.DataFrame]]:
    """Results by method and size, both in order, the last method of the alphabet first."""
    for (method, minutes), group in reversed(
        list(frame.groupby(["method", "novice_minutes"]))
    ):
        yield str(method), float(minutes), group


def size_style(method: str, index: int) -> dict[str, Any]:
    """A method's colour, with a line style by the number of the size."""
    line = ("-", "--", "-.", ":", (0, (5, 1, 1, 1)), (0, (1, 3)))[index % 6]
    return {"color": METHOD_STYLES[method]["color"], "linestyle": line, "marker": ""}


@styled
def learning_curves(
    frame: pd.DataFrame, systems: Sequence[str] = tuple(SYSTEMS)
) -> Figure:
    """Novice test loss against samples seen, a thin line a trial."""
    ylabel = "novice test loss, equation (1)\n(raw units squared)"
    axis = dict(
        xscale="log", yscale="log", xlabel="samples seen (control steps)", ylabel=ylabel
    )
    figure, plots = by_system(frame, systems, **axis)
    for axes, here in plots:
        sizes = sorted(here.novice_minutes.unique())
        for method, minutes, group in by_method_and_size(here):
            style = size_style(method, sizes.index(minutes))
            for number, one in enumerate(group.itertuples()):
                label = (
                    f"{METHOD_STYLES[method]['label']}, {minutes:g} min"
                    if number == 0
                    else None
                )
                axes.plot(
                    one.curve_samples, one.curve_test_loss, lw=0.9, label=label, **style
                )
        finish(axes, legend=False)
    if drawn := labelled(figure.axes):
        figure.legend(drawn.values(), drawn.keys(), loc="outside right upper")
    return figure
