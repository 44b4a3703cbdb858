"""Figure of an evaluation: errors by component, and by the number of steps ahead."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ownrobot.fitting.errors import ONE_STEP, OPEN_LOOP
from sidm.plots import finish, side_by_side, styled

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

SMALLEST = 1e-12  # of an error that another one is divided by
MUTED, NOTHING, MEAN = "0.45", "nothing changes", "the mean"


@styled
def figure(table: pd.DataFrame) -> Figure:
    """Figure of a table of errors from `Model.evaluate`, one step ahead and open loop.

    The first panel has a bar for each component of y: the error one step ahead, divided
    by the error of predicting the mean, beside the error of predicting no change. For a
    body with a pose, two more panels have the errors of position (m) and heading (rad)
    against the time ahead.
    """
    components = table[table.prediction == ONE_STEP]
    ahead = table[table.prediction == OPEN_LOOP]
    open_loop = ahead[ahead.quantity.isin(("position", "heading"))]
    figure, panels = side_by_side(3 if len(open_loop) else 1)
    mean = components["mean"].clip(lower=SMALLEST)
    names = components.quantity
    panels[0].barh(names, components.rmse / mean, label="model")
    still = components.nothing_changes / mean
    panels[0].plot(still, names, "|", color=MUTED, ms=12, mew=2, label=NOTHING)
    panels[0].axvline(1, color=MUTED, ls=":", label=MEAN)
    panels[0].invert_yaxis()
    panels[0].set(xlabel="error / error of predicting the mean", title="one step")
    finish(panels[0])
    errors = open_loop.groupby("quantity", sort=False)
    for axes, (name, rows) in zip(panels[1:], errors, strict=False):
        axes.plot(rows.horizon, rows.rmse, marker="", label="model")
        axes.plot(rows.horizon, rows.nothing_changes, "--", color=MUTED, label=NOTHING)
        axes.plot(rows.horizon, rows["mean"], ":", color=MUTED, label=MEAN)
        label = f"{name} error ({rows.unit.iloc[0]})"
        axes.set(xlabel="time ahead (s)", ylabel=label, ylim=(0, None))
        axes.set_title(f"{name}, open loop")
        finish(axes)
    return figure
