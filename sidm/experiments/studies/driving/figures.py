"""Pictures of driving, from the records of `driving`: shares of goals, ways from above, an animation."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sidm.control.drivers import ARRIVED
from sidm.experiments.figures.animation import film
from sidm.experiments.figures.style import (
    METHOD_STYLES,
    finish,
    half_width,
    lay_ground,
    legend_below,
    side_by_side,
    styled,
)
from sidm.experiments.studies.driving.drive import Driven, episode
from sidm.experiments.studies.driving.results import SHORT, Way, drivers, score
from sidm.systems import SYSTEMS

SHOWN = 4  # episodes whose ways are drawn
LOOKS: dict[str, dict[str, Any]] = {
    "simulator": {"color": "#009E73", "linestyle": "-."},
    "straight": {"color": "#555555", "linestyle": ":"},
}


@styled
def arrivals_figure(found: Iterable[Driven], systems: Sequence[str] = tuple(SYSTEMS)) -> Figure:
    """Share of goals reached by the data that the model has learnt from; level lines are the other drivers."""
    figure, panels = side_by_side(len(systems))
    for axes, system in zip(panels, systems, strict=True):
        mine = drivers(found, system)
        axes.set(xlabel="novice data of the model (min)", ylabel="goals reached (-)", title=system, ylim=(-0.03, 1.03))
        sizes = _draw_models(axes, mine)
        for one in mine:
            if not one.method:
                mean, look = score(one), LOOKS[one.kind]
                share, label = mean.arrived, f"{one.label}, {mean.episodes} episodes"
                axes.axhline(share.value, label=label, marker="", **look)
                axes.axhspan(share.low, share.high, color=look["color"], alpha=0.1, lw=0)
        finish(axes, sizes, legend=False)
    legend_below(figure, panels)
    return figure


def _draw_models(axes: Axes, every: Sequence[Way]) -> set[float]:
    """Points of the learned models, and their sizes."""
    sizes: set[float] = set()
    for number, method in enumerate(dict.fromkeys(one.method for one in every if one.method)):
        mine = [one for one in every if one.method == method]
        minutes = np.array([one.minutes for one in mine])
        share = np.array([score(one).arrived for one in mine])  # (M, 3)
        reach = np.abs(share[:, 1:] - share[:, :1]).T
        look = METHOD_STYLES[method] | ({"label": SHORT[method]} if method in SHORT else {})
        axes.errorbar(minutes * (0.96 + 0.08 * number), share[:, 0], reach, capsize=3, **look)
        sizes |= set(minutes.tolist())
    if sizes:
        axes.set_xscale("log")
    return sizes


@styled
def paths_figure(found: Iterable[Driven], system: str) -> Figure:
    """The ways of drivers over the first grounds, seen from above; a dot at each start, a circle around each goal."""
    figure, panels = side_by_side(SHOWN, columns=2)
    mine = drivers(found, system)
    for number, axes in enumerate(panels):
        axes.set(xlabel="x (m)", ylabel="y (m)", title=f"episode {number}", aspect="equal")
        if any(one.path(number) is not None for one in mine):
            _draw_ways(axes, mine, number)
        finish(axes, legend=False)
    legend_below(figure, panels)
    return figure


def _looks(every: Sequence[Way]) -> list[dict[str, Any]]:
    """How the drivers' ways are drawn; of a method, those of less data are paler."""
    sizes = sorted({one.minutes for one in every if one.method}, reverse=True)
    shades = {size: 1 - 0.65 * rank / max(len(sizes) - 1, 1) for rank, size in enumerate(sizes)}
    looks = []
    for one in every:
        look = LOOKS.get(one.kind, {})
        if one.method:
            style = METHOD_STYLES[one.method]
            look = {"color": style["color"], "linestyle": style["linestyle"], "alpha": shades[one.minutes]}
        looks.append(look | {"label": one.label})
    return looks


def driving_film(found: Iterable[Driven], system: str, number: int = 0) -> bytes:
    """An animated GIF of an episode, seen from above: all drivers set out together, each stands where it ended.

    Raises:
        ValueError: nobody has driven that episode.
    """
    every = drivers(found, system)
    ways = [(one.path(number), look) for one, look in zip(every, _looks(every), strict=True)]
    shown = [(way, look) for way, look in ways if way is not None]
    if not shown:
        raise ValueError(f"no driver of {system} has a stored way of episode {number}")
    one = episode(system, number)
    return film([way for way, _ in shown], [look for _, look in shown], one.heights, one.goal)


def _draw_ways(axes: Axes, every: Sequence[Way], number: int) -> None:
    """One episode's ground, goal and ways."""
    one = episode(every[0].system, number)
    lay_ground(axes, one.heights, one.heights.min(), one.heights.max())
    points = [one.goal[None]]
    for driver, look in zip(every, _looks(every), strict=True):
        way = driver.path(number)
        if way is not None:
            axes.plot(*way.T, marker="", **look)
            points.append(way)
    axes.scatter(0, 0, s=16, color="black", zorder=3)
    axes.add_patch(plt.Circle(tuple(one.goal), ARRIVED, fill=False, color="black"))
    seen = np.vstack(points)
    middle, reach = (seen.max(0) + seen.min(0)) / 2, max(np.ptp(seen, axis=0)) / 2 + 1
    limit = half_width(one.heights)
    axes.set(xlim=np.clip(middle[0] + np.array([-reach, reach]), -limit, limit))
    axes.set(ylim=np.clip(middle[1] + np.array([-reach, reach]), -limit, limit))
