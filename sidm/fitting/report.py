"""Figure of an evaluation: errors by component, and by the number of steps ahead."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sidm.plots import finish, side_by_side, styled

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@styled
def figure(table: pd.DataFrame) -> Figure:
    """Figure of a model's errors, one step ahead and open loop.

    The first panel has a bar for each component of y: the error one step ahead, divided
    by the error of predicting the mean. For a body with a pose, two more panels have
    the position error (m) and the heading error (rad) against the steps ahead.

    Args:
        table: as `Model.evaluate` returns.
    """
    open_loop = table[table.quantity.isin(("position", "heading"))]
    components = table[~table.index.isin(open_loop.index)]
    figure, panels = side_by_side(3 if len(open_loop) else 1)
    panels[0].barh(components.quantity, components.share)
    panels[0].invert_yaxis()
    panels[0].set(xlabel="error / error of predicting the mean (-)", title="one step")
    finish(panels[0], legend=False)
    errors = open_loop.groupby("quantity", sort=False)
    for axes, (name, rows) in zip(panels[1:], errors, strict=False):
        axes.plot(rows.horizon, rows.error, marker="")
        label = f"{name} error ({rows.unit.iloc[0]})"
        axes.set(xlabel="steps ahead", ylabel=label, ylim=(0, None))
        axes.set_title(f"{name}, open loop")
        finish(axes, legend=False)
    return figure
