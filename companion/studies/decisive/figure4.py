"""Figure 4, predicted paths, with recipe R as released; mean errors as a table."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.curves import size_style
from companion.figures.style import (
    METHOD_LABELS,
    METHOD_STYLES,
    legend_below,
    system_label,
)
from companion.methods import COMPARED
from ownrobot.plots import finish, side_by_side, styled
from sidm.drives import CONTROL_STEP
from sidm.systems import PAPER_SYSTEMS

MINUTES = (5.0, 120.0)  # of novice data, as in the paper
#: Time of a prediction with its unit -> index of its step.
STEPS = {"0.5 s (m)": 4, "1 s (m)": 9, "2.5 s (m)": 24}


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """The rows of `verdicts.results` that Figure 4 shows."""
    return frame[
        frame.recipe.eq("R")
        & frame.method.isin(COMPARED)
        & frame.novice_minutes.isin(MINUTES)
    ]


def median_drive(rows: pd.DataFrame) -> int:
    """Number of the stored drive whose last deviation is the median of them.

    The mean over the trainings, of one system, counts.
    """
    pairs = zip(rows.rollouts_predicted, rows.rollouts_actual, strict=True)
    apart = [np.subtract(np.array(path), np.array(actual)) for path, actual in pairs]
    last = [np.linalg.norm(path[:, -1, :2], axis=1) for path in apart]
    means = np.mean(last, axis=0)
    return int(np.argsort(means)[len(means) // 2])


@styled
def figure(rows: pd.DataFrame, drive: int | None = None, seed: int = 0) -> Figure:
    """Figure 4 under recipe R, of the rows of `table`: a row per system.

    One plot has the distance of the predicted from the actual position over time, the
    mean over seeds with its standard error; the other a stored drive from above: number
    `drive`, 0 to 2, by default that of `median_drive`, as the models of a seed predict
    it.
    """
    figure, panels = side_by_side(2 * len(PAPER_SYSTEMS), 2)
    plots = zip(panels[::2], panels[1::2], PAPER_SYSTEMS, strict=True)
    for left, right, system in plots:
        shown = rows[rows.system == system]
        left.set(xlabel="time (s)", ylabel="distance from the truth (m)")
        left.set_title(f"{system_label(system)}: all test drives")
        right.set(xlabel="x (m)", ylabel="y (m)")
        right.set_title(f"{system_label(system)}: one of them")
        if len(shown):
            _draw_deviations(left, shown)
            number = median_drive(shown) if drive is None else drive
            _draw_drive(right, shown[shown.seed == seed], number)
        finish(left, legend=False)
        finish(right, legend=False)
    legend_below(figure, panels)
    return figure


def _draw_deviations(axes: Axes, shown: pd.DataFrame) -> None:
    for (method, minutes), group in shown.groupby(["method", "novice_minutes"]):
        label = f"{METHOD_STYLES[method]['label']}, {minutes:g} min"
        style = size_style(method, MINUTES.index(minutes))
        _draw_deviation(axes, group, label, style)


def _draw_deviation(
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


def _draw_drive(axes: Axes, shown: pd.DataFrame, number: int) -> None:
    for row in shown.itertuples():
        path = np.array(row.rollouts_predicted)[number, :, :2]
        axes.plot(*path.T, **size_style(row.method, MINUTES.index(row.novice_minutes)))
    if len(shown):
        path = np.array(shown.rollouts_actual.iloc[0])[number, :, :2]
        line: dict[str, Any] = {"color": "black", "linestyle": "-", "marker": ""}
        axes.plot(*path.T, label="actual path", **line)
        axes.set_aspect("equal", adjustable="datalim")


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
