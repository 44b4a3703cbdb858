"""Open-loop errors of several models against the time ahead."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd
from matplotlib.figure import Figure

from companion.figures.style import METHOD_STYLES
from sidm.plots import finish, side_by_side, styled


@styled
def horizon_errors(tables: Mapping[str, pd.DataFrame], rate: float) -> Figure:
    """Open-loop errors of position and heading, one line per method.

    Args:
        tables: by method, as `fit.evaluate` gives them.
        rate: of the body, Hz.
    """
    figure, panels = side_by_side(2)
    units = {"position": "m", "heading": "rad"}
    for axes, (name, unit) in zip(panels, units.items(), strict=True):
        for method, table in tables.items():
            errors = table[table.quantity == name]
            style = METHOD_STYLES[method] | {"marker": ""}
            axes.plot(errors.horizon / rate, errors.error, **style)
        axes.set(xlabel="time ahead, open loop (s)", ylabel=f"{name} error ({unit})")
        axes.set(ylim=(0, None), title=f"{name} on drives held out")
        finish(axes, legend=name == "position")
    return figure
