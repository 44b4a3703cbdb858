"""Pictures of driving: shares of goals, ways from above, an animation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.beyond.drivers import ARRIVED
from companion.figures.animation import film
from companion.figures.style import (
    METHOD_STYLES,
    by_system,
    half_width,
    lay_ground,
    legend_below,
)
from companion.studies.driving.measure import episode
from companion.studies.driving.results import DRIVER, SHORT, label
from sidm.plots import finish, side_by_side, styled
from sidm.systems import SYSTEMS

SHOWN = 4  # episodes whose ways are drawn
LOOKS: dict[str, dict[str, Any]] = {
    "simulator": {"color": "#009E73", "linestyle": "-."},
    "straight": {"color": "#555555", "linestyle": ":"},
}


@styled
def figure(scores: pd.DataFrame, systems: Sequence[str] = tuple(SYSTEMS)) -> Figure:
    """Share of goals reached by the data that the model has learnt from; level lines are the other drivers."""
    axis: dict[str, Any] = dict(
        xlabel="novice data of the model (min)", ylabel="goals reached (share)"
    )
    figure, plots = by_system(scores, systems, ylim=(-0.03, 1.03), **axis)
    for axes, mine in plots:
        models = mine[mine.method != ""]
        for number, (method, some) in enumerate(models.groupby("method", sort=False)):
            reach = np.abs(some[["low", "high"]].sub(some.arrived, axis=0)).T
            look = METHOD_STYLES[str(method)] | (
                {"label": SHORT[str(method)]} if method in SHORT else {}
            )
            axes.errorbar(
                some.novice_minutes * (0.96 + 0.08 * number),
                some.arrived,
                reach,
                capsize=3,
                **look,
            )
        if len(models):
            axes.set_xscale("log")
        for one in mine[mine.method == ""].itertuples():
            look, words = (
                LOOKS[one.driver],
                f"{label(one.driver, '', 0)}, {one.episodes} episodes",
            )
            axes.axhline(one.arrived, label=words, marker="", **look)
            axes.axhspan(one.low, one.high, color=look["color"], alpha=0.1, lw=0)
        finish(axes, models.novice_minutes, legend=False)
    legend_below(figure, figure.axes)
    return figure


def ways(
    table: pd.DataFrame, system: str, number: int
) -> list[tuple[np.ndarray, dict[str, Any]]]:
    """The stored ways (K + 1, 2) of an episode with their looks; of a method, those of less data are paler."""
    mine = table[(table.system == system) & (table.episode == number)].dropna(
        subset="path"
    )
    sizes = sorted(
        table[(table.system == system) & (table.method != "")].novice_minutes.unique(),
        reverse=True,
    )
    shades = {
        size: 1 - 0.65 * rank / max(len(sizes) - 1, 1)
        for rank, size in enumerate(sizes)
    }
    found = []
    for one in mine.drop_duplicates(DRIVER).itertuples():
        look = LOOKS.get(one.driver, {})
        if one.method:
            style = METHOD_STYLES[one.method]
            look = {
                "color": style["color"],
                "linestyle": style["linestyle"],
                "alpha": shades[one.novice_minutes],
            }
        found.append(
            (
                one.path,
                look | {"label": label(one.driver, one.method, one.novice_minutes)},
            )
        )
    return found


@styled
def paths_figure(table: pd.DataFrame, system: str) -> Figure:
    """The ways of drivers over the first grounds, seen from above; a dot at each start, a circle around each goal."""
    figure, panels = side_by_side(SHOWN, columns=2)
    for number, axes in enumerate(panels):
        axes.set(
            xlabel="x (m)", ylabel="y (m)", title=f"episode {number}", aspect="equal"
        )
        drawn = ways(table, system, number)
        if drawn:
            _draw_ways(axes, system, number, drawn)
        finish(axes, legend=False)
    legend_below(figure, panels)
    return figure


def driving_film(table: pd.DataFrame, system: str) -> bytes:
    """An animated GIF of the first episode, seen from above: all drivers set out together, each stands where it ended.

    Raises:
        ValueError: nobody has driven it.
    """
    shown = ways(table, system, 0)
    if not shown:
        raise ValueError(f"no driver of {system} has a stored way of episode 0")
    one = episode(system, 0)
    return film(
        [way for way, _ in shown], [look for _, look in shown], one.heights, one.goal
    )


def _draw_ways(
    axes: Axes,
    system: str,
    number: int,
    drawn: Sequence[tuple[np.ndarray, dict[str, Any]]],
) -> None:
    """One episode's ground, goal and ways."""
    one = episode(system, number)
    lay_ground(axes, one.heights, one.heights.min(), one.heights.max())
    for way, look in drawn:
        axes.plot(*way.T, marker="", **look)
    axes.scatter(0, 0, s=16, color="black", zorder=3)
    axes.add_patch(plt.Circle(tuple(one.goal), ARRIVED, fill=False, color="black"))
    seen = np.vstack([one.goal[None], *(way for way, _ in drawn)])
    middle, reach = (seen.max(0) + seen.min(0)) / 2, max(np.ptp(seen, axis=0)) / 2 + 1
    limit = half_width(one.heights)
    axes.set(xlim=np.clip(middle[0] + np.array([-reach, reach]), -limit, limit))
    axes.set(ylim=np.clip(middle[1] + np.array([-reach, reach]), -limit, limit))
