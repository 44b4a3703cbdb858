"""Where the plots of a figure are in its picture, so that a narrow page stacks them.

The places are written into the PNG file itself. `book/extensions/stacked.py` reads them
when a page is rendered.
"""

from __future__ import annotations

import io
import json
from typing import Any, NamedTuple

from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.transforms import Bbox

KEY = "Plots"  # of the PNG file's text with the places
GAP = 0.05  # inch, kept around each part
LABELS = {"x": "labelbottom", "y": "labelleft"}  # parameters of ticks


class Part(NamedTuple):
    """A part of a picture, in pixels from its upper left; a spacer has height 0."""

    left: float
    top: float
    width: float
    height: float


def show_stackable() -> None:
    """Let IPython write the places of the plots into the pictures of figures."""
    from IPython.core.getipython import get_ipython

    shell: Any = get_ipython()
    if shell is not None:
        shell.enable_matplotlib("inline")  # which registers its own way first
        shell.display_formatter.formatters["image/png"].for_type(Figure, png)


def png(figure: Figure) -> bytes:
    """A PNG file of a figure, cut close, with the places of its plots."""
    figure.draw_without_rendering()
    box = figure.get_tightbbox().padded(rcParams["savefig.pad_inches"])
    scale = figure.dpi
    places = [[_in_picture(part, box, scale) for part in row] for row in rows(figure)]
    file = io.BytesIO()
    text = {KEY: json.dumps(places)}
    colour = figure.get_facecolor()
    figure.savefig(file, dpi=scale, bbox_inches=box, facecolor=colour, metadata=text)
    return file.getvalue()


def _in_picture(part: Bbox, picture: Bbox, dpi: float) -> Part:
    left = (part.x0 - picture.x0) * dpi
    top = (picture.y1 - part.y1) * dpi if part.height else 0.0
    return Part(*(round(n) for n in (left, top, part.width * dpi, part.height * dpi)))


def rows(figure: Figure) -> list[list[Bbox]]:
    """The rows of a narrow figure: boxes, in inches, of parts of a drawn figure.

    Each plot is a row, with the labels that a neighbour has for it. A bar of colours
    stays beside the plot next to it. What is written above all plots comes first, the
    entries of the figure's legends come last. A box of height 0 is a spacer.
    """
    inches = figure.dpi_scale_trans.inverted()
    plots = _plots(figure)
    stacked = [row for axes, box in plots.items() for row in _labelled(axes, box)]
    stacked += [_entries(legend) for legend in figure.legends]
    stacked = [[text.get_window_extent()] for text in figure.texts] + stacked
    boxes = [[box.transformed(inches) for box in row] for row in stacked]
    return [_padded(row) for row in boxes]


def _padded(row: list[Bbox]) -> list[Bbox]:
    """A row with some room around it; its boxes stay as close as they are."""
    x0, x1 = min(box.x0 for box in row), max(box.x1 for box in row)
    grown = []
    for box in row:
        left, right = GAP * (box.x0 == x0), GAP * (box.x1 == x1)
        up = GAP if box.height else 0.0
        sides = [[box.x0 - left, box.y0 - up], [box.x1 + right, box.y1 + up]]
        grown.append(Bbox(sides))
    return grown


def _plots(figure: Figure) -> dict[Axes, Bbox]:
    """Each plot with its box, which includes the bar of colours next to it."""
    boxes = {axes: axes.get_tightbbox() for axes in figure.axes}
    drawn = {axes: box for axes, box in boxes.items() if box is not None}
    bars = [axes for axes in drawn if axes.get_label() == "<colorbar>"]
    plots = {axes: box for axes, box in drawn.items() if axes not in bars}
    for bar in bars:
        left = drawn[bar].x0
        nearest = min(plots, key=lambda axes: abs(plots[axes].x1 - left))
        plots[nearest] = Bbox.union([plots[nearest], drawn[bar]])
    return plots


def _labelled(axes: Axes, box: Bbox) -> list[list[Bbox]]:
    """The rows of a plot: left of it and below it what a plot that shares an axis has.

    Args:
        axes: the plot.
        box: of the plot and what belongs to it, in pixels.
    """
    row, below, inner = [box], [], axes.get_window_extent()
    left = _labels(axes, "y")
    if left:
        row.insert(0, Bbox([[left.x0, box.y0], [left.x1, box.y1]]))
    bottom = _labels(axes, "x")
    if bottom:
        below = [Bbox([[box.x0, bottom.y0], [box.x1, bottom.y1]])]
        if left:
            below.insert(0, Bbox([[left.x0, inner.y0], [left.x1, inner.y0]]))
    return [row, below] if below else [row]


def _labels(axes: Axes, which: str) -> Bbox | None:
    """Place of the labels of an axis that another plot has for this one, or None."""
    if _has_labels(axes, which):
        return None
    side, corner = f"{which}axis", f"{which}0"
    place = getattr(axes.get_window_extent(), corner)
    siblings = getattr(axes, f"get_shared_{which}_axes")().get_siblings(axes)
    for other in filter(lambda sibling: _has_labels(sibling, which), siblings):
        difference = getattr(other.get_window_extent(), corner) - place
        if abs(difference) < 1:  # pixel: in the same row or column
            return getattr(other, side).get_tightbbox()
    return None


def _has_labels(axes: Axes, which: str) -> bool:
    axis = getattr(axes, f"{which}axis")
    return axis.get_tick_params().get(LABELS[which], True)


def _entries(legend: Legend) -> list[Bbox]:
    """Boxes of the entries of a legend, in pixels: a sample with its text."""
    point = legend.figure.dpi / 72
    size = legend.prop.get_size_in_points() * point
    before = (legend.handlelength + legend.handletextpad) * size
    between = legend.columnspacing * size / 2  # a column's neighbour begins after it
    boxes = [text.get_window_extent() for text in legend.get_texts()]
    return [
        Bbox([[box.x0 - before, box.y0], [box.x1 + between, box.y1]]) for box in boxes
    ]
