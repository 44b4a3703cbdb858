"""Parts that all figures share: styles, names of methods, plots side by side.

`pyplot`, the slow part of Matplotlib, is imported only when something is drawn, so that
commands that list trials stay fast.
"""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.stacked import png
from companion.methods import FOR_LITTLE, METHODS
from ownrobot.plots import side_by_side
from sidm.systems import GRID_SPACING

#: Colour, line and marker of a method; a dashed line may be (offset, dashes).
_STYLES: dict[str, tuple[str, Any, str]] = {
    "sidm": ("#0072B2", "-", "o"),
    "novice_only": ("#D55E00", "--", "s"),
    "no_regularisation": ("#009E73", "-.", "^"),
    "pretrain_finetune": ("#CC79A7", ":", "D"),
    # methods that may do better, and the method without a network
    "least_squares": ("#009E73", (0, (3, 1, 1, 1)), "P"),
    "corrected": ("#8C6D00", (0, (3, 1, 1, 1)), "p"),
    "corrected_mirrored": ("#332288", "-", "h"),
    "corrected_averaged": ("#44AA99", (0, (5, 1)), "H"),
    "mirrored": ("#882255", "-", "*"),
    "averaged": ("#7F3FBF", (0, (5, 1)), "X"),
    "tethered": ("#000000", (0, (1, 1)), "v"),
    "adapters": ("#8C6D00", "-.", "P"),
    "copies": ("#E69F00", "-", "^"),
    "copies_no_regularisation": ("#56B4E9", "--", "<"),
    "core_finetune": ("#E69F00", "-.", "v"),
}
_PLAIN = "#555555", "-", "."  # for methods that no curve shows


def _style(colour: str, line: Any, marker: str) -> dict[str, Any]:
    return {"color": colour, "linestyle": line, "marker": marker}


#: Style and label of each method. Colour (Okabe and Ito), line and marker tell methods
#: apart.
METHOD_STYLES: dict[str, dict[str, Any]] = {
    name: _style(*_STYLES.get(name, _PLAIN)) | {"label": method.label}
    for name, method in METHODS.items()
}
METHOD_STYLES |= {  # with settings for little data: see `studies.tuning`
    name + FOR_LITTLE: METHOD_STYLES[name]
    | {"color": colour, "marker": marker}
    | {"label": f"{METHODS[name].label}, tuned for little data"}
    for name, colour, marker in (
        ("sidm", "#56B4E9", "v"),
        ("novice_only", "#E69F00", "^"),
    )
}
#: Method -> its label.
METHOD_LABELS = {name: style["label"] for name, style in METHOD_STYLES.items()}
#: Styles of the two robots where a figure tells them apart: neutral, since colours are
#: those of methods.
ROLE_STYLES: dict[str, dict[str, Any]] = {
    "novice": _style("#1A1A1A", "-", "o"),
    "expert": _style("#8C8C8C", "--", "s"),
}
#: Styles of the sizes of novice data, where a figure tells sizes apart: neutral, too.
SIZE_STYLES: tuple[dict[str, Any], ...] = (
    _style("#1A1A1A", "-", "o"),
    _style("#7A7A7A", "--", "s"),
    _style("#949494", "-.", "^"),
    _style("#4D4D4D", ":", "D"),
    _style("#666666", (0, (6, 1, 1, 1)), "v"),
)
LOSS_LABEL = "validation loss\n(squared SI units, summed)"
LINE, MOST_LETTERS = 0.25, 38  # of a legend: inch, and letters for two columns
#: Axes of a plot of losses against novice data.
LOSS_BY_SIZE = dict(
    xscale="log", yscale="log", xlabel="novice data (min)", ylabel=LOSS_LABEL
)


def html_picture(figure: Figure, words: str) -> str:
    """A figure as HTML, with words for readers who cannot see it."""
    file = io.BytesIO()
    figure.savefig(file, format="png")
    return _image(file.getvalue(), words)


def html_plots(figure: Figure, words: str) -> str:
    """Plots as HTML that a narrow page stacks, see `figures.stacked`."""
    return _image(png(figure), words, ' class="plots"')


def _image(content: bytes, words: str, look: str = "") -> str:
    data = base64.b64encode(content).decode()
    return f'<img{look} src="data:image/png;base64,{data}" alt="{escape(words)}">'


def html_chart(specification: dict[str, Any], figure: Figure, words: str) -> str:
    """A Vega chart as HTML, which book/static/charts.js draws over the figure."""
    picture, script = html_picture(figure, words), json_script(specification, "chart")
    return f'<div class="vega-chart">{picture}{script}</div>'


def json_script(content: Any, name: str) -> str:
    """JSON types as a script element of a class, for a page's own scripts to read."""
    text = json.dumps(content, separators=(",", ":")).replace("</", "<\\/")
    return f'<script type="application/json" class="{name}">{text}</script>'


def half_width(heights: np.ndarray) -> float:
    """Distance from the middle of a ground (H, H) to its border, m."""
    return (len(heights) - 1) * GRID_SPACING / 2


def draw_ground(axes: Axes, heights: np.ndarray, palest: float, darkest: float) -> None:
    """Draw a ground (H, H), m, seen from above, in greys pale enough for lines."""
    half = half_width(heights)
    axes.imshow(
        heights,
        origin="lower",
        extent=(-half, half, -half, half),
        cmap="Greys",
        alpha=0.6,
        vmin=palest,
        vmax=darkest,
    )
    axes.grid(False)


def draw_surroundings(
    axes: Axes, points: np.ndarray, heights: np.ndarray, margin: float
) -> None:
    """Draw the ground (H, H), m, around points (N, 2), m, in a square with a margin, m.

    The square ends at the border of the ground. The greys span the heights within it.
    """
    half = half_width(heights)
    reach = float(np.ptp(points, axis=0).max()) / 2 + margin
    middle = (points.max(0) + points.min(0)) / 2
    ends = np.clip(middle + np.array([[-reach], [reach]]), -half, half)
    (left, low), (right, high) = ((ends + half) / GRID_SPACING).round().astype(int)
    seen = heights[low : high + 1, left : right + 1]
    lowest, relief = seen.min(), max(float(np.ptp(seen)), 0.05)
    draw_ground(axes, heights, lowest, lowest + 1.5 * relief)
    axes.set(xlim=ends[:, 0], ylim=ends[:, 1], xlabel="x (m)", ylabel="y (m)")


def mean_and_range(axes: Axes, table: pd.DataFrame, **style: Any) -> None:
    """Draw the `mean` of a table by its index, with a shade from `min` to `max`."""
    axes.plot(table.index, table["mean"], **style)
    shade = {"color": style["color"], "alpha": 0.2, "lw": 0}
    axes.fill_between(table.index, table["min"], table["max"], **shade)


def system_label(system: str) -> str:
    """The name of a system in a text: 'system 1', 'system 1, free struts'."""
    return system.replace("system", "system ").replace("_", ", ", 1).replace("_", " ")


def system_panels(
    table: pd.DataFrame, systems: Sequence[str], title: str = "{}", **options: Any
) -> tuple[Figure, list[tuple[Axes, pd.DataFrame]]]:
    """A figure with a plot per system, two in a row, and its rows of a table.

    In the title '{}' stands for the name of the system; options are of `Axes.set`.
    """
    figure, panels = side_by_side(len(systems), min(len(systems), 2))
    plots = []
    for axes, system in zip(panels, systems, strict=True):
        axes.set(title=title.format(system_label(system)), **options)
        plots.append((axes, table[table.system == system]))
    return figure, plots


def share_labels(panels: Sequence[Axes]) -> None:
    """Let plots of a row share the y axis of the first, which alone has its labels."""
    for axes in panels[1:]:
        axes.sharey(panels[0])
        axes.tick_params(labelleft=False)


def legend_entries(panels: Iterable[Axes]) -> dict[str, Any]:
    """Label -> what is drawn with this label in some plots."""
    return {
        name: handle
        for axes in panels
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True)
    }


def legend_below(figure: Figure, panels: Iterable[Axes]) -> None:
    """Add one legend for all plots below them, where it covers nothing."""
    drawn = legend_entries(panels)
    if drawn:
        columns = 1 if max(map(len, drawn)) > MOST_LETTERS else 2
        added = LINE * -(-len(drawn) // columns)
        figure.set_figheight(figure.get_figheight() + added)
        place: dict[str, Any] = {"loc": "outside lower center", "ncols": columns}
        figure.legend(drawn.values(), drawn.keys(), **place)
