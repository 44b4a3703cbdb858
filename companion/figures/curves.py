"""Results as curves, each a Matplotlib Figure in the book's style.

Figures are safe for colour-blind readers and opaque, with units on every axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from companion.figures.style import (
    LOSS_BY_SIZE,
    METHOD_STYLES,
    legend_below,
    mean_and_range,
    system_panels,
)
from companion.methods import FIGURE3
from companion.statistics.pairs import unique_results
from ownrobot.plots import finish, styled
from sidm.systems import PAPER_SYSTEMS


@styled
def figure3(
    frame: pd.DataFrame,
    systems: Sequence[str] = PAPER_SYSTEMS,
    methods: Sequence[str] = FIGURE3,
) -> Figure:
    """Figure 3: validation loss against novice data.

    Lines are means over the seeds of each size; shades reach from minimum to maximum. A
    dotted level marks the method `expert_only`, which has no novice data, where its
    results are in `frame`.
    """
    figure, plots = system_panels(frame, systems, **LOSS_BY_SIZE)
    for system, (axes, rows) in zip(systems, plots, strict=True):
        sizes: set[float] = set()
        for method in methods:
            results = unique_results(rows, system, [method])
            results = results[["novice_minutes", "validation_loss"]].astype(float)
            if len(results):
                by_size = results.groupby("novice_minutes").validation_loss
                losses = by_size.agg(["mean", "min", "max"])
                mean_and_range(axes, losses, **METHOD_STYLES[method])
                sizes |= set(losses.index)
        expert_only = rows[rows.method == "expert_only"].validation_loss
        if len(expert_only):
            style = METHOD_STYLES["expert_only"] | {"marker": "", "linestyle": ":"}
            axes.axhline(expert_only.mean(), **style)
            shade = {"color": style["color"], "alpha": 0.12, "lw": 0}
            axes.axhspan(expert_only.min(), expert_only.max(), **shade)
        finish(axes, sizes, legend=False)
    legend_below(figure, figure.axes)
    return figure


def size_style(method: str, index: int) -> dict[str, Any]:
    """Line style of a method and a size: the method's colour, dashes by `index`."""
    line = ("-", "--", "-.", ":", (0, (5, 1, 1, 1)), (0, (1, 3)))[index % 6]
    return {"color": METHOD_STYLES[method]["color"], "linestyle": line, "marker": ""}
