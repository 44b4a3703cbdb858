"""Figures of evaluations: errors by component, and by how far ahead."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sidm.plots import finish, side_by_side, styled

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
    for axes, (name, mine) in zip(
        panels[1:], ahead.groupby("quantity", sort=False), strict=False
    ):
        axes.plot(mine.horizon, mine.error, marker="")
        axes.set(
            xlabel="steps ahead",
            ylabel=f"{name} error ({mine.unit.iloc[0]})",
            ylim=(0, None),
        )
        axes.set_title(f"{name}, open loop")
        finish(axes, legend=False)
    return figure
