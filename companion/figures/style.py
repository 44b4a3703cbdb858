"""What all figures have in common: the style, how methods look, plots side by side.

`pyplot`, the slow part of Matplotlib, is imported when something is drawn: those who
list trials do without.
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

from companion.methods import FOR_LITTLE, METHODS
from sidm.plots import side_by_side
from sidm.systems import GRID_SPACING

_LOOKS: dict[str, dict[str, Any]] = {
    "sidm": {"color": "#0072B2", "linestyle": "-", "marker": "o"},
    "novice_only": {"color": "#D55E00", "linestyle": "--", "marker": "s"},
    "no_regularisation": {"color": "#009E73", "linestyle": "-.", "marker": "^"},
    "pretrain_finetune": {"color": "#CC79A7", "linestyle": ":", "marker": "D"},
}
_LOOKS |= {  # of what might do better, and of no network
    "least_squares": {
        "color": "#009E73",
        "linestyle": (0, (3, 1, 1, 1)),
        "marker": "P",
    },
    "corrected": {"color": "#D55E00", "linestyle": (0, (3, 1, 1, 1)), "marker": "p"},
    "corrected_mirrored": {"color": "#882255", "linestyle": "-", "marker": "h"},
    "corrected_averaged": {"color": "#44AA99", "linestyle": (0, (5, 1)), "marker": "H"},
    "mirrored": {"color": "#009E73", "linestyle": "-", "marker": "*"},
    "averaged": {"color": "#7F3FBF", "linestyle": (0, (5, 1)), "marker": "X"},
    "tethered": {"color": "#000000", "linestyle": (0, (1, 1)), "marker": "v"},
    "adapters": {"color": "#8C6D00", "linestyle": "-.", "marker": "P"},
    "copies": {"color": "#E69F00", "linestyle": "-", "marker": "^"},
    "copies_no_regularisation": {"color": "#56B4E9", "linestyle": "--", "marker": "<"},
    "core_finetune": {"color": "#E69F00", "linestyle": "-.", "marker": "v"},
}
#: of methods that no curve shows
_PLAIN = {"color": "#555555", "linestyle": "-", "marker": "."}

#: How a method is drawn and named, told apart by colour (Okabe and Ito), line and
#: marker.
METHOD_STYLES: dict[str, dict[str, Any]] = {
    name: _LOOKS.get(name, _PLAIN) | {"label": method.label}
    for name, method in METHODS.items()
}
METHOD_STYLES |= {  # with other settings: see `studies.tuning`
    name + FOR_LITTLE: METHOD_STYLES[name]
    | look
    | {"label": f"{METHODS[name].label}, tuned for little data"}
    for name, look in {
        "sidm": {"color": "#56B4E9", "marker": "v"},
        "novice_only": {"color": "#E69F00", "marker": "^"},
    }.items()
}
SIZE_STYLES: tuple[dict[str, Any], ...] = (
    {"color": "#0072B2", "linestyle": "-", "marker": "o"},
    {"color": "#D55E00", "linestyle": "--", "marker": "s"},
    {"color": "#009E73", "linestyle": "-.", "marker": "^"},
    {"color": "#CC79A7", "linestyle": ":", "marker": "D"},
    {"color": "#E69F00", "linestyle": (0, (6, 1, 1, 1)), "marker": "v"},
)
LOSS_LABEL = "validation loss, equation (1)\n(squared m, m/s and rad/s, summed)"
#: The axes of a plot of losses by novice data.
LOSS_BY_SIZE = dict(
    xscale="log", yscale="log", xlabel="novice data (min)", ylabel=LOSS_LABEL
)
#: How a data-efficiency ratio is drawn: its bound, marker, colour and words.
EFFICIENCY_MARKS = (
    ("=", "o", "#0072B2", "ratio"),
    (">=", "^", "#D55E00", "at least"),
    ("<=", "v", "#009E73", "at most"),
)


def html_picture(figure: Figure, words: str) -> str:
    """A figure as HTML with a text in its place for who cannot see it, for a page that takes it over from another."""
    file = io.BytesIO()
    figure.savefig(file, format="png")
    data = base64.b64encode(file.getvalue()).decode()
    return f'<img src="data:image/png;base64,{data}" alt="{escape(words)}">'


def html_chart(specification: dict[str, Any], figure: Figure, words: str) -> str:
    """A chart of Vega's as HTML, which book/static/charts.js draws, and until then a figure in its place."""
    text = json.dumps(specification, separators=(",", ":")).replace("</", "<\\/")
    script = f'<script type="application/json">{text}</script>'
    return f'<div class="vega-chart">{html_picture(figure, words)}{script}</div>'


def half_width(heights: np.ndarray) -> float:
    """From the middle of a ground (H, H) to its border, m."""
    return (len(heights) - 1) * GRID_SPACING / 2


def lay_ground(axes: Axes, heights: np.ndarray, palest: float, darkest: float) -> None:
    """A ground (H, H), m, under what is drawn from above: grey from one height to another, pale enough for lines."""
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


def mean_and_range(axes: Axes, found: pd.DataFrame, **style: Any) -> None:
    """A line through the `mean` of a table by its index, shaded from `min` to `max`."""
    axes.plot(found.index, found["mean"], **style)
    axes.fill_between(
        found.index, found["min"], found["max"], color=style["color"], alpha=0.2, lw=0
    )


def named(system: str) -> str:
    """A system in words: 'system 1', 'system 1, free struts'."""
    return system.replace("system", "system ").replace("_", ", ", 1).replace("_", " ")


def by_system(
    table: pd.DataFrame, systems: Sequence[str], title: str = "{}", **looks: Any
) -> tuple[Figure, list[tuple[Axes, pd.DataFrame]]]:
    """A figure with a plot a system, two in a row, its name in the title; the plots, each with the system's lines."""
    figure, panels = side_by_side(len(systems), min(len(systems), 2))
    for axes, system in zip(panels, systems, strict=True):
        axes.set(title=title.format(named(system)), **looks)
    return figure, [
        (axes, table[table.system == system])
        for axes, system in zip(panels, systems, strict=True)
    ]


def labelled(panels: Iterable[Axes]) -> dict[str, Any]:
    """What is drawn in some plots, by its label, each once."""
    return {
        name: handle
        for axes in panels
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True)
    }


def legend_below(figure: Figure, panels: Iterable[Axes]) -> None:
    """One legend for all plots, below them, where the names would cover what they name."""
    drawn = labelled(panels)
    if drawn:
        figure.set_figheight(figure.get_figheight() + 0.25 * -(-len(drawn) // 2))
        figure.legend(drawn.values(), drawn.keys(), loc="outside lower center", ncols=2)
