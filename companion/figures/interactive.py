"""Charts that Vega draws in the reader's browser without a kernel: Figure 3.

A chart has three parameters, which book/static/charts.js sets to colours of the page:
`ink` of text and axes, `faint` of grids, `paper` of the background.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import altair as alt
import pandas as pd

from companion.figures.style import METHOD_LABELS, METHOD_STYLES, system_label
from companion.statistics.savings import ratio_texts

INK, FAINT, PAPER = "#222832", "#d8d8d8", "#ffffff"  # in light mode and elsewhere
TEXT = 13  # size of text, pixels
#: Matplotlib's line style -> dashes of Vega.
DASHES = {"-": [1, 0], "--": [6, 3], ":": [2, 2], "-.": [6, 2, 2, 2]}


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


def figure3(
    frame: pd.DataFrame, saved: pd.DataFrame, methods: Sequence[str], words: str
) -> dict[str, Any]:
    """The specification of Figure 3's chart.

    The reader chooses the system, switches methods on and off, and points at a seed to
    read its loss. `saved` is made by `savings`; `words` say what the chart shows, for
    readers who cannot see it.
    """
    styles = [METHOD_STYLES[name] for name in methods]
    labels = [style["label"] for style in styles]
    colours = [style["color"] for style in styles]
    lines = [style["linestyle"] for style in styles]  # a name or (offset, dashes)
    dashes = [DASHES[one] if isinstance(one, str) else [*one[1]] for one in lines]
    systems = list(dict.fromkeys(frame.system))
    radio = alt.binding_radio(
        options=systems, labels=[*map(system_label, systems)], name="pair of robots: "
    )
    system = alt.param(name="system", value=(systems or [""])[0], bind=radio)
    shown = alt.selection_point(name="shown", fields=["method"], bind="legend")
    # the labels of the methods that the chosen system has, as Vega computes them
    drawn = {
        name: [METHOD_LABELS[method] for method in methods if method in set(of)]
        for name, of in frame.groupby("system").method
    }
    legend = alt.Legend(
        orient="bottom",
        columns=alt.ExprRef("width < 400 ? 1 : 2"),  # one on a telephone
        labelLimit=300,
        values=alt.ExprRef(f"({json.dumps(drawn)})[system]"),
    )
    log = alt.Scale(type="log", nice=False)
    minutes = sorted(frame.novice_minutes.unique())
    base = (
        alt.Chart()
        .transform_filter("datum.system == system")
        .encode(
            x=alt.X(
                "minutes:Q",
                title="novice data (min)",
                scale=log,
                axis=alt.Axis(values=minutes, format="~g", grid=False),
            ),
            color=alt.Color(
                "method:N",
                title="click to show one",
                scale=alt.Scale(domain=labels, range=colours),
                legend=legend,
            ),
            opacity=alt.condition(shown, alt.value(1), alt.value(0.06)),
        )
    )
    ticks = [0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.7, 1, 2, 5]
    axis = alt.Axis(values=ticks, format="~g")
    y = alt.Y("loss:Q", title="validation loss", scale=log, axis=axis)
    seeds = base.mark_circle(size=18).encode(
        y=y,
        tooltip=[
            "method:N",
            "minutes:Q",
            "seed:Q",
            alt.Tooltip("loss:Q", title="loss", format=".3f"),
        ],
    )
    dash = alt.Scale(domain=labels, range=dashes)
    curves = base.mark_line().encode(
        y=y, strokeDash=alt.StrokeDash("method:N", scale=dash, legend=None)
    )
    means = base.mark_point(filled=True, size=70).encode(
        y=y,
        tooltip=[
            "method:N",
            "minutes:Q",
            alt.Tooltip("loss:Q", title="mean loss", format=".3f"),
            alt.Tooltip("saved:N", title="data without SIDM, same loss"),
        ],
    )
    rows = _seeds(frame, methods)
    trials = alt.Data(values=rows.to_dict("records"))
    points = alt.Data(values=_means(rows, saved).to_dict("records"))
    chart = alt.layer(
        seeds.properties(data=trials),
        curves.properties(data=points),
        means.properties(data=points),
    )
    return themed(chart.add_params(system, shown).properties(height=330), words)


def _seeds(frame: pd.DataFrame, methods: Sequence[str]) -> pd.DataFrame:
    columns = ["system", "method", "novice_minutes", "seed", "validation_loss"]
    rows = frame[frame.method.isin(methods)][columns]
    names = {"novice_minutes": "minutes", "validation_loss": "loss"}
    labels = rows.method.map(METHOD_LABELS)
    return rows.assign(method=labels).rename(columns=names).round(4)


def _means(seeds: pd.DataFrame, saved: pd.DataFrame) -> pd.DataFrame:
    """One row per system, method and size: the mean `loss`, and `saved` as text."""
    point = ["system", "method", "minutes"]
    means = seeds.groupby(point).loss.mean().reset_index()
    labels = saved.method.map(METHOD_LABELS)
    times = saved.assign(method=labels, saved=ratio_texts(saved))
    times = times.rename(columns={"novice_minutes": "minutes"})[[*point, "saved"]]
    # without savings or results a column has no type of its own
    table = means.astype({"minutes": float}).merge(
        times.astype({"minutes": float}), how="left"
    )
    return table.assign(saved=table.saved.fillna("-")).round(4)
