"""Figures of driving: shares of goals reached, paths from above, an animation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.extensions.drivers import ARRIVED
from companion.figures.animation import film
from companion.figures.style import (
    METHOD_STYLES,
    draw_surroundings,
    legend_below,
    system_panels,
)
from companion.studies.driving.measure import episode
from companion.studies.driving.results import DRIVER, SHORT, label
from ownrobot.plots import finish, side_by_side, styled
from sidm.systems import PAPER_SYSTEMS

SHOWN = 4  # episodes whose paths are drawn
MARGIN = 1.0  # m of ground shown around them
#: Styles of the drivers that have no learned model.
DRIVER_STYLES: dict[str, dict[str, Any]] = {
    "simulator": {"color": "#1A1A1A", "linestyle": "-."},
    "straight": {"color": "#555555", "linestyle": ":"},
}


@styled
def figure(scores: pd.DataFrame, systems: Sequence[str] = PAPER_SYSTEMS) -> Figure:
    """Share of goals reached against the size of the data that the model learned from.

    Bars and bands are Wilson's 95 % intervals; level lines are the drivers that have no
    learned model.
    """
    axis: dict[str, Any] = dict(
        xlabel="novice data of the model (min)", ylabel="goals reached (share)"
    )
    figure, plots = system_panels(scores, systems, ylim=(-0.03, 1.03), **axis)
    for axes, shown in plots:
        models = shown[shown.method != ""]
        for number, (method, group) in enumerate(models.groupby("method", sort=False)):
            reach = np.abs(group[["low", "high"]].sub(group.arrived, axis=0)).T
            # side by side, so that bars do not cover each other
            minutes = group.novice_minutes * (0.92 + 0.08 * number)
            style = METHOD_STYLES[str(method)] | {"label": SHORT[str(method)]}
            style |= {"linestyle": "", "capsize": 3}
            axes.errorbar(minutes, group.arrived, reach, **style)
        if len(models):
            axes.set_xscale("log")
        for row in shown[shown.method == ""].itertuples():
            style = DRIVER_STYLES[row.driver]
            text = f"{label(row.driver, '', 0)}, {row.episodes} episodes"
            axes.axhline(row.arrived, label=text, marker="", **style)
            axes.axhspan(row.low, row.high, color=style["color"], alpha=0.1, lw=0)
        finish(axes, models.novice_minutes, legend=False)
    legend_below(figure, figure.axes)
    return figure


def episode_paths(
    table: pd.DataFrame, system: str, number: int
) -> list[tuple[np.ndarray, dict[str, Any]]]:
    """The stored paths (K + 1, 2) of all drivers in an episode, with their styles.

    Among the models of a method, those of less data are paler.
    """
    rows = table[table.system == system]
    sizes = sorted(rows[rows.method != ""].novice_minutes.unique(), reverse=True)
    stored = rows[rows.episode == number].dropna(subset="path")
    paths = []
    for row in stored.drop_duplicates(DRIVER).itertuples():
        style = DRIVER_STYLES.get(row.driver, {})
        if row.method:
            method_style = METHOD_STYLES[row.method]
            style = {name: method_style[name] for name in ("color", "linestyle")}
            rank = sizes.index(row.novice_minutes)
            style["alpha"] = 1 - 0.65 * rank / max(len(sizes) - 1, 1)
        text = label(row.driver, row.method, row.novice_minutes)
        paths.append((row.path, style | {"label": text}))
    return paths


@styled
def paths_figure(table: pd.DataFrame, system: str) -> Figure:
    """Paths of all drivers in the first episodes, seen from above.

    A dot marks each start, a circle each goal.
    """
    figure, panels = side_by_side(SHOWN, columns=2)
    for number, axes in enumerate(panels):
        axes.set_title(f"episode {number}")
        if paths := episode_paths(table, system, number):
            heights, _, goal = episode(system, number)
            points = np.vstack([goal[None], *(path for path, _ in paths)])
            draw_surroundings(axes, points, heights, MARGIN)
            for path, style in paths:
                axes.plot(*path.T, marker="", **style)
            axes.scatter(0, 0, s=16, color="black", zorder=3)
            axes.add_patch(plt.Circle(tuple(goal), ARRIVED, fill=False, color="black"))
        finish(axes, legend=False)
    legend_below(figure, panels)
    return figure


def first_film(table: pd.DataFrame, systems: Sequence[str]) -> Any:
    """The film of the first of some systems with stored paths, as IPython's output.

    All drivers of the first episode start together, and each stays where it ended.
    """
    from IPython.display import Image, Markdown  # late: not every command has it

    for system in systems:
        if paths := episode_paths(table, system, 0):
            first = episode(system, 0)
            curves, styles = zip(*paths, strict=True)
            return Image(film(curves, styles, first.heights, first.goal))
    return Markdown("No trials stored.")
