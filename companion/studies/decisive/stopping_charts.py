"""Charts of the page with a movable stopping point, as Vega draws them.

book/static/stopping.js fills in the data; `stopping_point` has the numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import altair as alt
from matplotlib.figure import Figure

from companion.figures.interactive import themed
from companion.figures.style import METHOD_STYLES, html_picture, json_script
from companion.studies.decisive.verdicts import END

HEIGHT = 250  # pixels
COLOUR = METHOD_STYLES["sidm"]["color"]  # of a saving
INK = alt.ExprRef("ink")


def axis(
    kind: Any, field: str, title: str, ends: Any, ticks: Any, form: str = "~g"
) -> Any:
    """A logarithmic axis, `alt.X` or `alt.Y`."""
    scale = alt.Scale(type="log", domain=list(ends), nice=False)
    shown = alt.Axis(values=list(ticks), format=form, labelOverlap=True)
    return kind(field, title=title, scale=scale, axis=shown)


SAMPLE_TICKS = (1e5, 3e5, 1e6, 3e6, 8e6)
SAMPLES = axis(alt.X, "x:Q", "samples seen in training", (1e5, 8e6), SAMPLE_TICKS, "~s")
LOSS_TICKS = (0.15, 0.2, 0.3, 0.4, 0.5, 0.7)
LOSSES = axis(alt.Y, "y:Q", "validation loss", (0.12, 0.8), LOSS_TICKS)


def named(name: str) -> alt.Chart:
    """A chart of data that the page fills in."""
    return alt.Chart(alt.NamedData(name=name))


def layers(*parts: Any) -> alt.LayerChart:
    """Charts over each other."""
    return alt.layer(*parts).properties(height=HEIGHT)


def _cursor() -> alt.Chart:
    rule = named("stop").mark_rule(color=INK, strokeWidth=1.5, tooltip=None)
    return rule.encode(x="x:Q")


def charts(methods: Mapping[str, Mapping[str, str]]) -> dict[str, dict[str, Any]]:
    """Specifications by the name of the chart, for methods with `label` and `color`."""
    names = [method["label"] for method in methods.values()]
    scale = alt.Scale(
        domain=names, range=[method["color"] for method in methods.values()]
    )
    colour = alt.Color("m:N", scale=scale, legend=None)
    return {
        "losses": themed(_training(colour), "Validation loss along the training"),
        "figure3": themed(_figure3(colour), "Validation loss by novice data"),
        "saving": themed(_saving(), "Data saved by an SIDM by length of training"),
        "search": themed(
            _search(colour), "Validation loss of each draw by weight decay"
        ),
    }


def _training(colour: Any) -> alt.LayerChart:
    """Loss along each training, and the weights that it keeps."""
    lines = named("curves").mark_line(clip=True, strokeWidth=1.2, opacity=0.55)
    lines = lines.encode(x=SAMPLES, y=LOSSES, color=colour, detail="s:N")
    kept = named("kept").mark_point(filled=True, size=60, clip=True, opacity=1)
    kept = kept.encode(x="x:Q", y="y:Q", color=colour)
    drawn = named("draw").mark_line(clip=True, color=INK, strokeWidth=2)
    return layers(lines, drawn.encode(x="x:Q", y="y:Q"), kept, _cursor())


def _figure3(colour: Any) -> alt.LayerChart:
    """Loss against novice data: mean over seeds, from minimum to maximum."""
    sizes = axis(alt.X, "x:Q", "novice data (min)", (0.9, 135), (1, 5, 20, 60, 120))
    base = named("sizes")
    band = base.mark_area(clip=True, opacity=0.2)
    band = band.encode(x=sizes, y=LOSSES, y2="high:Q", color=colour)
    means = base.mark_line(clip=True, point={"filled": True, "size": 60})
    return layers(band, means.encode(x="x:Q", y="mean:Q", color=colour))


def _saving() -> alt.LayerChart:
    """Data ratio against the length of training, with rules and the stopping point."""
    ticks = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20)
    ratio = axis(alt.Y, "y:Q", "data without SIDM / with SIDM", (0.1, 30), ticks)
    line = named("saving").mark_line(clip=True, color=COLOUR)
    line = line.encode(x=SAMPLES, y=ratio)
    band = named("saving").mark_area(clip=True, opacity=0.2, color=COLOUR)
    band = band.encode(x="x:Q", y=alt.Y("low:Q"), y2="high:Q")
    one = alt.Chart(alt.Data(values=[{"y": 1}])).mark_rule(color=INK, strokeDash=[4, 3])
    rules = named("rules").mark_point(filled=True, size=80, color=COLOUR, opacity=1)
    rules = rules.encode(x="x:Q", y="y:Q")
    names = [
        named("rules")
        .transform_filter(f"(datum.rule == '{END}') == {str(above).lower()}")
        .mark_text(align="right", dy=-12 if above else 16, color=INK)
        .encode(x="x:Q", y="y:Q", text="rule:N")
        for above in (True, False)
    ]
    whisker = named("here").mark_rule(color=INK, strokeWidth=2, clip=True)
    whisker = whisker.encode(x="x:Q", y="low:Q", y2="high:Q")
    here = named("here").mark_point(filled=True, size=110, color=INK, opacity=1)
    here = here.encode(x="x:Q", y="y:Q")
    return layers(
        line, band, one.encode(y="y:Q"), rules, *names, whisker, here, _cursor()
    )


def _search(colour: Any) -> alt.LayerChart:
    """What each draw of the search keeps, against its weight decay."""
    ticks = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
    decay = axis(alt.X, "x:Q", "weight decay", (8e-7, 0.4), ticks, "~e")
    words = alt.Tooltip("words:N", title="draw")
    points = named("draws").mark_point(filled=True, size=90, clip=True, opacity=0.9)
    points = points.encode(x=decay, y=LOSSES, color=colour, tooltip=words)
    ring = named("picked").mark_point(size=260, color=INK, strokeWidth=2, filled=False)
    return layers(points, ring.encode(x="x:Q", y="y:Q"))


def html(
    contents: Mapping[str, Any], figure: Figure, words: str, names: Sequence[str] = ()
) -> str:
    """The charts with their numbers, which book/static/stopping.js puts together.

    `contents` are those of `stopping_point`. The figure, with `words` for readers who
    cannot see it, is shown where there is no script. `names` are the charts to show, in
    their order; all by default. Without `search` its numbers are left out.
    """
    drawn = charts(contents["methods"])
    names = names or list(drawn)
    if "search" not in names:
        contents = {**contents, "search": []}
    parts = {"numbers": contents, "charts": {name: drawn[name] for name in names}}
    scripts = "".join(
        json_script(part, f"stopping-{name}") for name, part in parts.items()
    )
    return f'<div class="stopping">{html_picture(figure, words)}{scripts}</div>'
