"""Predicted paths, Figure 4."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.figures.curves import by_method_and_size, size_style
from companion.figures.style import METHOD_STYLES, legend_below
from sidm.drives import CONTROL_STEP
from sidm.plots import finish, side_by_side, styled


@styled
def figure4(frame: pd.DataFrame, seed: int = 0) -> Figure:
    """Figure 4: deviation of the predicted from the actual path over time, and one example seen from above.

    Args:
        frame: of one system; lines are means over the trials, shades their standard
            error.
        seed: whose trials draw the example's paths.
    """
    figure, (left, right) = side_by_side(2)
    left.set(
        xlabel="time (s)",
        ylabel="distance from the actual position (m)",
        title="all test drives",
    )
    right.set(xlabel="x (m)", ylabel="y (m)", title="one of them from above")
    sizes = sorted(frame.novice_minutes.unique())
    for method, minutes, group in by_method_and_size(frame):
        style = size_style(method, sizes.index(minutes))
        label = f"{METHOD_STYLES[method]['label']}, {minutes:g} min"
        # (S, K + 1)
        errors = np.array([(0.0, *error) for error in group.position_error])
        time, mean = CONTROL_STEP * np.arange(errors.shape[1]), errors.mean(0)
        left.plot(time, mean, label=label, **style)
        if len(errors) > 1:
            spread = errors.std(0, ddof=1) / np.sqrt(len(errors))
            left.fill_between(
                time,
                mean - spread,
                mean + spread,
                color=style["color"],
                alpha=0.15,
                lw=0,
            )
        for path in group[group.seed == seed].example_predicted:
            right.plot(*np.array(path).T, **style)  # lines as on the left
    for path in frame[frame.seed == seed].example_actual[:1]:
        right.plot(
            *np.array(path).T,
            color="black",
            linestyle="-",
            marker="",
            label="actual path",
        )
        right.set_aspect("equal", adjustable="datalim")
    finish(left, legend=False)
    finish(right, legend=False)
    legend_below(figure, [left, right])
    return figure


class Example(NamedTuple):
    """Figure 4's example beside all test trajectories, m."""

    driven: float  # how far the robot goes
    nearest: float  # from where it comes to, of the predicted paths of a seed's models
    farthest: float
    mean: float  # of that distance over all test trajectories and trials


def example(frame: pd.DataFrame, seed: int) -> Example | None:
    """The example with the models of `seed`; None where they are not stored."""
    shown = frame[frame.seed == seed]
    if not len(shown):
        return None
    actual = np.array(shown.example_actual.iloc[0])
    parted = [
        float(np.linalg.norm(path[-1] - actual[-1]))
        for path in map(np.array, shown.example_predicted)
    ]
    driven = float(np.linalg.norm(np.diff(actual, axis=0), axis=1).sum())
    return Example(
        driven,
        min(parted),
        max(parted),
        float(frame.position_error.str[-1].astype(float).mean()),
    )
