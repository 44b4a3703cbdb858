"""Charts of Vega that follow the page's colours, in light and in dark mode.

A chart has three parameters, which book/static/charts.js sets to colours of the page:
`ink` of text and axes, `faint` of grids, `paper` of the background.
"""

from __future__ import annotations

from typing import Any

import altair as alt

INK, FAINT, PAPER = "#222832", "#d8d8d8", "#ffffff"  # in light mode and elsewhere
TEXT = 13  # size of text, pixels


def themed(chart: Any, words: str) -> dict[str, Any]:
    """The specification of a chart in the page's colours, as wide as its place."""
    ink, faint, paper = (
        alt.param(name=name, value=value)
        for name, value in (("ink", INK), ("faint", FAINT), ("paper", PAPER))
    )
    text = {
        "labelColor": {"expr": "ink"},
        "titleColor": {"expr": "ink"},
        "labelFontSize": TEXT,
        "titleFontSize": TEXT,
        "titleFontWeight": "normal",
    }
    lines = {name: {"expr": "faint"} for name in ("gridColor", "domainColor")}
    return (
        chart.add_params(ink, faint, paper)
        .properties(width="container", description=words)
        .configure(background=alt.ExprRef("paper"), font="sans-serif")
        .configure_axis(**text, **lines, tickColor={"expr": "faint"})
        .configure_legend(**text)
        .configure_title(color={"expr": "ink"}, fontSize=TEXT + 1, anchor="start")
        .configure_view(stroke=None)
        .to_dict(validate=False)
    )
