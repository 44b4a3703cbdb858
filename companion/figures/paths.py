"""Predicted paths: Figure 4."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.curves import size_style
from companion.figures.style import METHOD_LABELS, legend_below
from sidm.drives import CONTROL_STEP
from sidm.plots import finish, side_by_side, styled

#: Time of a prediction with its unit -> index of its step.
STEPS = {"0.5 s (m)": 4, "1 s (m)": 9, "2.5 s (m)": 24}


@styled
def figure4(frame: pd.DataFrame, seed: int = 0) -> Figure:
    """Figure 4: deviation of predicted from actual paths over time, and an example.

    Lines are means over the trials of one system, shades their standard error. The
    example, seen from above, has the paths of the trials of a seed.
    """
    figure, (left, right) = side_by_side(2)
    left.set(xlabel="time (s)", ylabel="distance from the actual position (m)")
    left.set(title="all test drives")
    right.set(xlabel="x (m)", ylabel="y (m)", title="one of them from above")
    sizes = sorted(frame.novice_minutes.unique())
    groups = list(frame.groupby(["method", "novice_minutes"]))
    for (method, minutes), group in reversed(groups):
        style = size_style(method, sizes.index(minutes))
        draw_deviation(left, group, f"{METHOD_LABELS[method]}, {minutes:g} min", style)
        for path in group[group.seed == seed].example_predicted:
            right.plot(*np.array(path).T, **style)  # the styles of the left plot
    for path in frame[frame.seed == seed].example_actual[:1]:
        style = {"color": "black", "linestyle": "-", "marker": ""}
        right.plot(*np.array(path).T, label="actual path", **style)
        right.set_aspect("equal", adjustable="datalim")
    finish(left, legend=False)
    finish(right, legend=False)
    legend_below(figure, [left, right])
    return figure


def draw_deviation(
    axes: Axes, group: pd.DataFrame, label: str, style: dict[str, Any]
) -> None:
    """Draw the mean deviation of trials over time, with its standard error as shade."""
    # (S, K + 1)
    errors = np.array([(0.0, *error) for error in group.position_error])
    time, mean = CONTROL_STEP * np.arange(errors.shape[1]), errors.mean(0)
    axes.plot(time, mean, label=label, **style)
    if len(errors) > 1:
        error = errors.std(0, ddof=1) / np.sqrt(len(errors))
        shade = {"color": style["color"], "alpha": 0.15, "lw": 0}
        axes.fill_between(time, mean - error, mean + error, **shade)


def mean_errors(frame: pd.DataFrame) -> pd.DataFrame:
    """Mean errors of predicted paths, by size of the novice's data and method.

    Columns, for one system: `trials`, their number; the distances from the actual
    positions after the times STEPS; the error of the heading after the last of them.
    """
    errors = {name: frame.position_error.str[k] for name, k in STEPS.items()}
    headings = np.degrees(frame.heading_error.str[24].astype(float))
    errors["heading, 2.5 s (degrees)"] = headings
    points = frame.assign(**errors).groupby(["novice_minutes", "method"])
    means = points[[*errors]].agg("mean").astype(float)
    means.insert(0, "trials", points.size())
    return means


def page_table(frame: pd.DataFrame) -> pd.DataFrame:
    """`mean_errors` of each system with the headings of a page."""
    if not len(frame):
        return pd.DataFrame()
    parts = {name: mean_errors(rows) for name, rows in frame.groupby("system")}
    table = pd.concat(parts, names=["system"]).reset_index()
    table = table.assign(method=table.method.map(METHOD_LABELS))
    return table.rename(columns={"novice_minutes": "novice data (min)"})
