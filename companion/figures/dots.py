"""Labelled dots: a named row for each thing compared, its values as dots.

`dot_plot` draws a table of ratios with their intervals. `dot_plots` and `name_rows` are
for figures with several dots in a row: names stand above their rows inside the plot, so
that they stay readable on a phone.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.style import METHOD_STYLES, share_labels
from ownrobot.plots import finish, side_by_side, styled

ROW, AROUND = 0.3, 1.2  # inch: for each row, around the rows
LETTERS = 56  # side by side below all plots
CLOSEST = 0.075  # two ticks, as a share of the width of all plots
TICKS = 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0, 100.0
ROOM = 1.08  # factor beyond the widest interval
#: Methods that have their own colour here, too; the others are told by their rows.
COLOURED = ("sidm", "novice_only", "pretrain_finetune")
NEUTRAL = "#333333"

NAMED_HEIGHT = 0.42  # inch, of a row with its name above
NARROW = 5.2  # inch, of a figure of one plot
HOLLOW = {"markerfacecolor": "white"}


@styled
def dot_plot(
    table: pd.DataFrame,
    xlabel: str,
    panels: Sequence[str] = (),
    ticks: Sequence[float] = TICKS,
) -> Figure:
    """Ratios as dots with their intervals, and each ratio as a number beside its row.

    Args:
        table: a row per dot, in the order of the rows: `panel` and `row`, the titles of
            its plot and its row, its `group`, a heading above rows or '', `method`,
            `value`, and `low` and `high`, NaN without an interval.
        xlabel: what a ratio is; a line marks the ratio 1.
        panels: titles of the plots, in their order; that of the table by default.
        ticks: places of the ticks, those in the range of the data that stand apart.
    """
    names = list(dict.fromkeys(table.panel))
    names = [name for name in panels or names if name in names]
    side_by = max(1, len(names))
    xlabel = textwrap.fill(xlabel, LETTERS // side_by)
    lines = _lines(table)
    drawn, plots = side_by_side(side_by)
    drawn.set_figheight(AROUND + ROW * max(5, len(lines)))
    ends = table[["value", "low", "high"]].to_numpy(float)
    if len(ends):
        limits = np.nanmin(ends) / ROOM, np.nanmax(ends) * ROOM
        ticks = apart(ticks, limits, CLOSEST * side_by)
    for axes, name in zip(plots, names, strict=False):
        axes.axvline(1.0, color="0.5", linestyle=":", marker="", zorder=0)
        axes.set(title=textwrap.fill(name, LETTERS // side_by))
        axes.set(xscale="log", xlabel=xlabel, xlim=limits)
        rows = table[table.panel == name]
        heights = [lines.index(line) for line in zip(rows.group, rows.row, strict=True)]
        colours = [
            METHOD_STYLES[method]["color"] if method in COLOURED else NEUTRAL
            for method in rows.method
        ]
        axes.hlines(heights, rows.low, rows.high, colors=colours, linewidth=1.6)
        axes.scatter(rows.value, heights, c=colours, s=38, zorder=3)
        place = axes.get_yaxis_transform()
        for height, value in zip(heights, rows.value, strict=True):
            text = f"{value:#.2g}".rstrip(".")
            axes.text(1.02, height, text, fontsize=10, va="center", transform=place)
    for axes in plots:
        finish(axes, ticks if len(ends) else (), legend=False)
    if lines:
        first = plots[0]
        first.set_yticks(range(len(lines)), [row or group for group, row in lines])
        first.set_ylim(len(lines) - 0.5, -0.5)
        for label, (_, row) in zip(first.get_yticklabels(), lines, strict=True):
            label.set_fontweight("normal" if row else "bold")
        share_labels(plots)
    return drawn


def apart(
    ticks: Sequence[float], limits: tuple[float, float], least: float
) -> list[float]:
    """The ticks within limits with room for their numbers, from that at 1 outwards.

    `least` is the distance of two ticks as a share of the axis.
    """
    low, high = np.log(limits)
    inside = [tick for tick in ticks if limits[0] < tick < limits[1]]
    kept: list[float] = []
    for tick in sorted(inside, key=lambda tick: abs(np.log(tick))):
        distances = [abs(np.log(tick / other)) for other in kept]
        if not kept or min(distances) >= least * (high - low):
            kept.append(tick)
    return sorted(kept)


def _lines(table: pd.DataFrame) -> list[tuple[str, str]]:
    """Group and row of each line from above; a heading has no row."""
    lines: list[tuple[str, str]] = []
    for group, rows in table.groupby("group", sort=False):
        lines += [(str(group), "")] if group else []
        lines += [(str(group), row) for row in dict.fromkeys(rows.row)]
    return lines


def dot_plots(
    count: int, rows: int, height: float = NAMED_HEIGHT
) -> tuple[Figure, list[Axes]]:
    """A figure of plots beside each other, each with room for rows of dots.

    A row with its name has a height in inches. One plot alone is narrow, since a phone
    cannot stack parts of it.
    """
    figure, panels = side_by_side(count)
    if count == 1:
        figure.set_figwidth(NARROW)
    figure.set_figheight(1.2 + height * max(rows, 3))
    return figure, panels


def name_rows(axes: Axes, names: Sequence[str], values: Sequence[str] = ()) -> None:
    """Write names above the rows y = 0, 1, ... of a plot, the first on top.

    `values` are texts at the right end of the rows, such as a range.
    """
    axes.set_ylim(len(names) - 0.55, -0.85)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    plain: dict[str, Any] = {"fontsize": 10, "va": "bottom", "zorder": 1}
    plain["transform"] = axes.get_yaxis_transform()
    plain["bbox"] = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
    for row, name in enumerate(names):
        axes.axhline(row, color="#DDDDDD", lw=0.6, linestyle="-", marker="", zorder=0)
        axes.text(0.0, row - 0.22, name, ha="left", **plain)
    for row, value in enumerate(values):
        axes.text(1.0, row - 0.22, value, ha="right", color="#555555", **plain)


def line_of_no_difference(axes: Axes) -> None:
    """Draw a vertical line where a ratio is 1."""
    axes.axvline(1, color="0.5", lw=1, linestyle="-", marker="", zorder=0.5)
