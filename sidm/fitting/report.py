"""Figures of evaluations: errors by component, and by how far ahead."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from sidm.experiments.figures.style import METHOD_STYLES, finish, side_by_side, styled

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@styled
def figure(table: pd.DataFrame) -> Figure:
    """Shares of what the mean leaves, a bar a component of y; errors open loop against the steps ahead.

    Args:
        table: as `fit.evaluate` gives it.
    """
    ahead = table[table.quantity.isin(("position", "heading"))]
    figure, panels = side_by_side(3 if len(ahead) else 1)
    parts = table[~table.index.isin(ahead.index)]
    panels[0].barh(parts.quantity, parts.share)
    panels[0].invert_yaxis()
    panels[0].set(xlabel="error / error of predicting the mean (-)", title="one step")
    finish(panels[0], legend=False)
    for axes, (name, mine) in zip(panels[1:], ahead.groupby("quantity", sort=False), strict=False):
        axes.plot(mine.horizon, mine.error, marker="")
        axes.set(xlabel="steps ahead", ylabel=f"{name} error ({mine.unit.iloc[0]})", ylim=(0, None))
        axes.set_title(f"{name}, open loop")
        finish(axes, legend=False)
    return figure


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
            axes.plot(mine.horizon / rate, mine.error, **METHOD_STYLES[method] | {"marker": ""})
        unit = {"position": "m", "heading": "rad"}[name]
        axes.set(xlabel="time ahead, open loop (s)", ylabel=f"{name} error ({unit})", ylim=(0, None))
        axes.set_title(f"{name} on drives held out")
        finish(axes, legend=name == "position")
    return figure
