"""Labelled dot plots: a named row for each thing compared, its values as dots.

Names stand above their rows inside the plot, so that they stay readable on a phone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sidm.plots import side_by_side

WIDTH = 5.4  # of a plot, inch
HEIGHT = 0.42  # of a row with its name, inch
HOLLOW = {"markerfacecolor": "white"}


def dot_plots(
    count: int, rows: int, height: float = HEIGHT
) -> tuple[Figure, list[Axes]]:
    """A figure of plots beside each other, each with room for rows of dots.

    A row with its name has a height in inches.
    """
    figure, panels = side_by_side(count)
    width = WIDTH if count == 1 else 3.9 * count
    figure.set_size_inches(width, 1.2 + height * max(rows, 3))
    return figure, panels


def name_rows(axes: Axes, names: Sequence[str], values: Sequence[str] = ()) -> None:
    """Write names above the rows y = 0, 1, ... of a plot, the first on top.

    `values` are texts at the right end of the rows, such as a range.
    """
    axes.set_ylim(len(names) - 0.55, -0.85)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    plain: dict[str, Any] = {"fontsize": 9.5, "va": "bottom", "zorder": 1}
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
