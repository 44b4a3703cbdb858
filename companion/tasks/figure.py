"""The benchmark's scores as a figure: a plot for each pair of robots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.style import SIZE_STYLES, share_labels
from companion.tasks.catalogue import MINUTES
from ownrobot.comparison.statistics import Interval
from ownrobot.methods.registry import METHODS
from sidm.plots import finish, side_by_side, styled

TICKS = 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.4, 1.7, 2.0, 2.5, 3.0  # of the scores
ROOM = 1.05  # factor of the scores beyond the widest interval
BESIDE = 0.2  # between the points of two sizes, in rows
#: Names of rows, in two lines where the plots would have no room beside them.
ROWS = {
    "novice_only": "network",
    "least_squares_corrected": "expert's least squares,\ncorrected",
    "gp_corrected": "expert's least squares,\ncorrected by a Gaussian process",
    "trees_corrected": "expert's trees,\ncorrected by trees",
    "pretrain_finetune": "expert's network,\nfine-tuned",
    "corrected": "expert's network,\ncorrected by least squares",
    "sidm": "SIDM",
}


@styled
def figure(scores: pd.DataFrame, methods: Sequence[str]) -> Figure:
    """The scores of methods with their intervals, those without an expert first.

    Args:
        scores: made by `scores_by_group`; a group is called 'robots' or, for a size of
            MINUTES, 'robots, 5 min'.
        methods: names of the methods, in the order of the rows.
    """
    methods = sorted(methods, key=lambda name: METHODS[name].needs_expert)
    shown = scores.reindex(methods)
    robots = list(dict.fromkeys(_robots_and_size(group)[0] for group in shown))
    drawn, panels = side_by_side(max(1, len(robots)), min(2, len(robots)))
    if not robots:
        finish(panels[0])
        return drawn
    height = 1.2 + 0.36 * len(methods)
    drawn.set_size_inches(drawn.get_figwidth(), -(-len(robots) // 2) * height)
    for axes, name in zip(panels, robots, strict=False):
        groups = [group for group in shown if _robots_and_size(group)[0] == name]
        _plot(axes, name, shown[groups], _range(shown))
    for axes in panels[len(robots) :]:
        axes.remove()
    for first in range(0, len(robots), 2):
        share_labels(panels[first : min(first + 2, len(robots))])
    return drawn


def _plot(
    axes: Axes, title: str, scores: pd.DataFrame, ends: tuple[float, float]
) -> None:
    """Draw the scores of methods (rows) in the groups of some robots (columns)."""
    for number, group in enumerate(scores):
        shift = BESIDE * (number - (len(scores.columns) - 1) / 2)
        _draw(axes, scores[group], shift, _style(_robots_and_size(group)[1]))
    alone = sum(not METHODS[name].needs_expert for name in scores.index)
    axes.axvline(1.0, color="0.5", linestyle=":", marker="")
    axes.axhline(alone - 0.5, color="0.8", linewidth=0.8, marker="")
    axes.set(title=title, xscale="log", xlabel="loss / that of least squares")
    finish(axes, [tick for tick in TICKS if ends[0] < tick < ends[1]], legend=False)
    if axes.get_legend_handles_labels()[0]:
        axes.legend()
    axes.set(xlim=ends, ylim=(len(scores) - 0.5, -0.5))
    names = [ROWS.get(name, METHODS[name].label) for name in scores.index]
    axes.set_yticks(range(len(scores)), names)


def _robots_and_size(group: str) -> tuple[str, str]:
    """The robots of a group of tasks, and its size such as '5 min', or ''."""
    name, _, size = group.rpartition(", ")
    return (name, size) if size.endswith(" min") else (group, "")


def _range(scores: pd.DataFrame) -> tuple[float, float]:
    """Ends of an axis for all scores and their intervals."""
    ends = np.array(
        [score for score in scores.to_numpy().flat if isinstance(score, Interval)],
        float,
    )
    if not len(ends):
        return 1 / ROOM, ROOM
    return float(np.nanmin(ends)) / ROOM, float(np.nanmax(ends)) * ROOM


def _style(size: str) -> dict[str, Any]:
    """Marker, colour and label of a size; that of the first without a size."""
    sizes = [f"{minutes:g} min" for minutes in MINUTES]
    style = SIZE_STYLES[sizes.index(size) if size else 0]
    return {**style, "linestyle": "", "label": size or None}


def _draw(
    axes: Axes, scores: pd.Series, shift: float, style: Mapping[str, Any]
) -> None:
    """Draw the scores of a group as points with their intervals, where there is one."""
    found = [
        (row, *score) for row, score in enumerate(scores) if isinstance(score, Interval)
    ]
    rows, value, low, high = np.array(found or np.empty((0, 4)), float).T
    bars = [value - low, high - value]
    axes.errorbar(value, rows + shift, xerr=bars, capsize=2, **style)
