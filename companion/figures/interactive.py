"""Figure 3 to touch: a chart that Vega draws in the reader's browser, without a kernel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import altair as alt
import pandas as pd

from companion.figures.style import METHOD_STYLES, named
from companion.statistics.savings import written

#: of Matplotlib's line styles
DASHES = {"-": [1, 0], "--": [6, 3], ":": [2, 2], "-.": [6, 2, 2, 2]}


def figure3(
    frame: pd.DataFrame, saved: pd.DataFrame, methods: Sequence[str], words: str
) -> dict[str, Any]:
    """The specification of Figure 3's chart: a system at a time, methods on and off, every seed under the pointer.

    Args:
        frame: of Figure 3.
        saved: how many times its data training without SIDM needs, of `savings`.
        methods: that are drawn.
        words: what the chart shows, for who cannot see it.
    """
    labels = [METHOD_STYLES[name]["label"] for name in methods]
    systems = list(dict.fromkeys(frame.system))
    radio = alt.binding_radio(
        options=systems, labels=[*map(named, systems)], name="pair of robots: "
    )
    system = alt.param(name="system", value=(systems or [""])[0], bind=radio)
    shown = alt.selection_point(name="shown", fields=["method"], bind="legend")
    looks = [METHOD_STYLES[name] for name in methods]
    dashes = [
        DASHES[line] if isinstance(line, str) else [*line[1]]
        for line in (one["linestyle"] for one in looks)
    ]
    minutes = sorted(frame.novice_minutes.unique())
    axis = alt.Axis(values=minutes, format="~g", grid=False)
    columns = alt.ExprRef("width < 400 ? 1 : 2")  # of the legend, on a telephone
    base = (
        alt.Chart()
        .transform_filter("datum.system == system")
        .encode(
            x=alt.X(
                "minutes:Q",
                title="novice data (min)",
                scale=alt.Scale(type="log", nice=False),
                axis=axis,
            ),
            color=alt.Color(
                "method:N",
                title="click to show one",
                scale=alt.Scale(domain=labels, range=[one["color"] for one in looks]),
                legend=alt.Legend(orient="bottom", columns=columns, labelLimit=300),
            ),
            opacity=alt.condition(shown, alt.value(1), alt.value(0.06)),
        )
    )
    loss = alt.Axis(
        values=[0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.7, 1, 2, 5], format="~g"
    )
    y = alt.Y(
        "loss:Q",
        title="validation loss",
        scale=alt.Scale(type="log", nice=False),
        axis=loss,
    )
    seeds = base.mark_circle(size=18).encode(
        y=y, tooltip=["method:N", "minutes:Q", "seed:Q", _number("loss", "loss")]
    )
    lines = base.mark_line().encode(
        y=y,
        strokeDash=alt.StrokeDash(
            "method:N", scale=alt.Scale(domain=labels, range=dashes), legend=None
        ),
    )
    means = base.mark_point(filled=True, size=70).encode(
        y=y,
        tooltip=[
            "method:N",
            "minutes:Q",
            _number("loss", "mean loss"),
            alt.Tooltip("saved:N", title="data without SIDM, same loss"),
        ],
    )
    points = alt.Data(values=_means(frame, saved, methods).to_dict("records"))
    chart = alt.layer(
        seeds.properties(
            data=alt.Data(values=_seeds(frame, methods).to_dict("records"))
        ),
        lines.properties(data=points),
        means.properties(data=points),
    )
    return (
        chart.add_params(system, shown)
        .properties(width="container", height=330, description=words)
        .configure(background="white", font="sans-serif")
        .configure_axis(labelFontSize=13, titleFontSize=13)
        .configure_legend(labelFontSize=13, titleFontSize=12)
        .to_dict(validate=False)
    )


def _number(field: str, title: str) -> Any:
    return alt.Tooltip(f"{field}:Q", title=title, format=".3f")


def _seeds(frame: pd.DataFrame, methods: Sequence[str]) -> pd.DataFrame:
    """A line a trial: system, method, minutes, seed, loss."""
    found = frame[frame.method.isin(methods)][
        ["system", "method", "novice_minutes", "seed", "validation_loss"]
    ]
    found = found.assign(
        method=found.method.map(lambda name: METHOD_STYLES[name]["label"])
    )
    return found.rename(
        columns={"novice_minutes": "minutes", "validation_loss": "loss"}
    ).round(4)


def _means(
    frame: pd.DataFrame, saved: pd.DataFrame, methods: Sequence[str]
) -> pd.DataFrame:
    """A line a point: its mean, and how many times its data training without SIDM needs."""
    means = (
        _seeds(frame, methods)
        .groupby(["system", "method", "minutes"])
        .loss.mean()
        .reset_index()
    )
    times = saved.assign(
        method=saved.method.map(lambda name: METHOD_STYLES[name]["label"]),
        saved=written(saved),
    )
    times = times[times.against == "novice_only"].rename(
        columns={"novice_minutes": "minutes"}
    )
    found = means.merge(times[["system", "method", "minutes", "saved"]], how="left")
    return found.assign(saved=found.saved.fillna("-")).round(4)
