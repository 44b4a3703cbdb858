"""Errors of several models open loop, against the time ahead."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd
from matplotlib.figure import Figure

from companion.figures.style import METHOD_STYLES
from sidm.plots import finish, side_by_side, styled


@styled
def compare(tables: Mapping[str, pd.DataFrame], rate: float) -> Figure:
    """Errors open loop, a line a method.

    Args:
        tables: by the method, as `fit.evaluate` gives them.
        rate: of the body, Hz.
    """
    figure, panels = side_by_side(2)
    for axes, name in zip(panels, ("position", "heading"), strict=True):
        for method, table in tables.items():
            mine = table[table.quantity == name]
            axes.plot(
                mine.horizon / rate,
                mine.error,
                **METHOD_STYLES[method] | {"marker": ""},
            )
        unit = {"position": "m", "heading": "rad"}[name]
        axes.set(
            xlabel="time ahead, open loop (s)",
            ylabel=f"{name} error ({unit})",
            ylim=(0, None),
        )
        axes.set_title(f"{name} on drives held out")
        finish(axes, legend=name == "position")
    return figure
