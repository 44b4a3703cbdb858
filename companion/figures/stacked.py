"""Where the plots of a figure are in its picture, so that a narrow page stacks them.

The places are written into the PNG file itself. `book/extensions/stacked.py` reads them
when a page is rendered.
"""

from __future__ import annotations

import io
import json
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.transforms import Bbox, BboxBase

KEY = "Plots"  # of the PNG file's text with the places
GAP = 0.05  # inch, kept around each part
Row = Sequence[BboxBase]  # boxes beside each other
LABELS = {"x": "labelbottom", "y": "labelleft"}  # parameters of ticks


class Part(NamedTuple):
    """A part of a picture, in pixels from its upper left; a spacer has height 0."""

    left: int
    top: int
    width: int
    height: int


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
    places = {
        name: [[_in_picture(part, box, scale) for part in row] for row in rows]
        for name, rows in parts(figure).items()
    }
    file = io.BytesIO()
    text = {KEY: json.dumps(places)}
    colour = figure.get_facecolor()
    figure.savefig(file, dpi=scale, bbox_inches=box, facecolor=colour, metadata=text)
    return file.getvalue()


def _in_picture(part: BboxBase, picture: BboxBase, dpi: float) -> Part:
    """The pixels that a box touches; all boxes are in inches."""
    left, right = ((x - picture.x0) * dpi for x in (part.x0, part.x1))
    top, bottom = ((picture.y1 - y) * dpi for y in (part.y1, part.y0))
    x, y = math.floor(left), math.floor(top)
    height = math.ceil(bottom) - y if part.height else 0
    return Part(x, y, math.ceil(right) - x, height)


def parts(figure: Figure) -> dict[str, list[Row]]:
    """Boxes, in inches, of what a drawn figure consists of, row by row.

    `plots`: each plot is a row, with the labels that a neighbour has for it; a bar of
    colours stays beside the plot next to it; a box of height 0 is a spacer. `title`:
    what is written above all plots. `legend`: the entries of legends.
    """
    inches = figure.dpi_scale_trans.inverted()
    found: dict[str, list[Row]] = {
        "title": [[text.get_window_extent()] for text in figure.texts],
        "plots": [r for axes, box in _plots(figure).items() for r in _rows(axes, box)],
        "legend": [_entries(legend) for legend in figure.legends],
    }
    return {
        name: [_padded([box.transformed(inches) for box in row]) for row in rows]
        for name, rows in found.items()
    }


def _padded(row: Row) -> Row:
    """A row with some room around it; its boxes stay as close as they are."""
    x0, x1 = min(box.x0 for box in row), max(box.x1 for box in row)
    grown: list[BboxBase] = []
    for box in row:
        left, right = GAP * (box.x0 == x0), GAP * (box.x1 == x1)
        up = GAP if box.height else 0.0
        sides = [[box.x0 - left, box.y0 - up], [box.x1 + right, box.y1 + up]]
        grown.append(Bbox(sides))
    return grown


def _plots(figure: Figure) -> dict[Axes, BboxBase]:
    """Each plot with its box, labels and the bar of colours next to it included.

    Of an empty plot there is its legend at most.
    """
    boxes: dict[Axes, BboxBase | None] = {}
    for axes in figure.axes:
        legend = axes.get_legend()
        if axes.axison or axes.has_data():
            boxes[axes] = axes.get_tightbbox()
        elif legend is not None:
            boxes[axes] = legend.get_window_extent()
    plots = {axes: box for axes, box in boxes.items() if box is not None}
    bars = [axes for axes in plots if axes.get_label() == "<colorbar>"]
    for bar in [plots.pop(axes) for axes in bars]:
        distances = {axes: abs(box.x1 - bar.x0) for axes, box in plots.items()}
        nearest = min(distances, key=distances.__getitem__)
        plots[nearest] = Bbox.union([plots[nearest], bar])
    return plots


def _rows(axes: Axes, box: BboxBase) -> list[Row]:
    """The rows of a plot with its box, pixels.

    Left of it and below it stands what a plot has that shares an axis.
    """
    left, below = _labels(axes, "y"), _labels(axes, "x")
    row: list[BboxBase] = [box]
    under = [Bbox([[box.x0, below.y0], [box.x1, below.y1]])] if below else []
    if left:
        row.insert(0, Bbox([[left.x0, box.y0], [left.x1, box.y1]]))
        spacer = Bbox([[left.x0, box.y0], [left.x1, box.y0]])
        under = [spacer, *under] if under else []
    return [row, under] if under else [row]


def _labels(axes: Axes, which: str) -> BboxBase | None:
    """Place of the labels of an axis that another plot has for this one, or None."""

    def axis_with_labels(one: Axes) -> Any:
        axis = getattr(one, f"{which}axis")
        return axis if axis.get_tick_params().get(LABELS[which], True) else None

    if axis_with_labels(axes):
        return None
    place = getattr(axes.get_window_extent(), f"{which}0")
    for other in getattr(axes, f"get_shared_{which}_axes")().get_siblings(axes):
        axis = axis_with_labels(other)
        difference = getattr(other.get_window_extent(), f"{which}0") - place
        if axis and abs(difference) < 1:  # pixel: in the same row or column
            return axis.get_tightbbox()
    return None


def _entries(legend: Legend) -> Row:
    """Boxes of the entries of a legend, in pixels: a sample with its text."""
    point = legend.figure.dpi / 72
    size = legend.prop.get_size_in_points() * point
    before = (legend.handlelength + legend.handletextpad) * size
    between = legend.columnspacing * size / 2  # a column's neighbour begins after it
    boxes = [text.get_window_extent() for text in legend.get_texts()]
    return [
        Bbox([[box.x0 - before, box.y0], [box.x1 + between, box.y1]]) for box in boxes
    ]
