"""The explorer's page: charts drawn by Vega in the browser, and the rides they show.

`write` puts scripts beside the page, so that nothing comes from another host: Vega, the
charts, the replay, and the rides in pieces that are loaded when they are needed;
book/static/explorer.js puts them together. Altair makes the charts; vl-convert brings
Vega's libraries.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import altair as alt
import numpy as np
import vl_convert

from companion.explorer import comparison
from companion.explorer.grid import (
    BODY,
    BRAKES,
    CHANNELS,
    DRIVE,
    FOLDER,
    GONE,
    KNOBS,
    PAIRS,
    PAPER_ROBOTS,
    SAMPLES,
    SET_UP,
    SPRINGS,
    STEPS,
    STOPS,
    WEAVING,
    Knob,
    ground,
    twin_name,
)
from companion.figures.interactive import themed
from companion.figures.style import half_width, system_label
from ownrobot.replay import scene
from ownrobot.replay.rides import SAMPLE_TIME, STRUTS
from ownrobot.replay.skeleton import heave_curves, rover_skeleton
from ownrobot.replay.viewer import (
    SCRIPTS,
    STYLE,
    cropped,
    ground_json,
    static,
    text,
)
from sidm.drives import CONTROL_STEP, Ground
from sidm.systems import GRID_SPACING, Robot

WHO = ("first", "second")
COLOURS = scene.COLOURS[: len(WHO)]  # as in the replay
#: Left, right, low and high end of the ground that the charts show, m.
VIEW = (-1.5, 14.5, -5.0, 5.0)
REPLAYED = (-4.0, 14.9, -9.0, 9.0)  # the same for the replay, m
CELL = 0.4  # side of a square of ground in the charts, m
TALLEST = 2.0  # height of the greyest ground, m


def _axis(kind: Any, field: str, title: str, start: float, end: float) -> Any:
    return kind(field, title=title, scale=alt.Scale(domain=[start, end], nice=False))


def _lines() -> alt.Chart:
    """Lines of both robots, told apart by colour and dashes."""
    colours = alt.Scale(domain=list(WHO), range=list(COLOURS))
    dashes = alt.Scale(domain=list(WHO), range=[[1, 0], [6, 3]])
    lines = alt.Chart(alt.NamedData(name="ride")).mark_line(clip=True)
    return lines.encode(
        color=alt.Color("who:N", scale=colours, legend=None),
        strokeDash=alt.StrokeDash("who:N", scale=dashes, legend=None),
        order="t:Q",
    )


def _over_time(title: str, **scale: Any) -> alt.Chart:
    x = _axis(alt.X, "t:Q", "time (s)", 0, CONTROL_STEP * STEPS)
    y = alt.Y("v:Q", title=title, scale=alt.Scale(zero=False, **scale))
    return _lines().encode(x=x, y=y)


def _travel() -> alt.LayerChart:
    low = min(_knob("travel_lower").values)
    lines = _over_time("travel (mm)", domain=[1e3 * low - 2, 6], nice=False)
    stops = alt.Chart(alt.NamedData(name="stops")).mark_rule(strokeDash=[2, 3])
    return lines + stops.encode(y="v:Q", color=alt.Color("who:N", legend=None))


def _path() -> alt.LayerChart:
    left, right, low, high = VIEW
    x = _axis(alt.X, "x:Q", "x (m)", left, right)
    y = _axis(alt.Y, "y:Q", "y (m)", low, high)
    pale = alt.Scale(domain=[0, TALLEST], range=[0, 0.9], clamp=True)
    shade = alt.Opacity("h:Q", scale=pale, legend=None)  # on white and on black
    squares = alt.Chart(alt.NamedData(name="ground")).mark_rect(color="#808080")
    cells = squares.encode(x=x, x2="x2:Q", y=y, y2="y2:Q", opacity=shade)
    return (cells + _lines().encode(x=x, y=y)).resolve_scale(color="independent")


def charts() -> dict[str, dict[str, Any]]:
    """Vega-Lite specifications of the charts by name, in their order on the page."""
    height = _over_time("height of the body (m)")
    pitch, roll = _over_time("pitch (degrees)"), _over_time("roll (degrees)")
    charts = {
        "height": (height, "Height of the body over time"),
        "path": (_path(), "Paths from above, heights in grey"),
        "pitch": (pitch, "Pitch over time, nose down positive"),
        "roll": (roll, "Roll over time, right side down positive"),
    }
    for number in (3, 2, 1, 0):  # as the struts lie, seen from above
        title = f"{STRUTS[number].capitalize()} strut, stops dotted"
        charts[f"strut {number}"] = _travel(), title
    return {
        name: themed(chart.properties(height=180, title=title), title)
        for name, (chart, title) in charts.items()
    }


def _ground(roughness: float) -> list[int]:
    """Heights of the squares of ground in VIEW, rows from low to high, cm."""
    heights = ground(roughness)

    def indices(start: float, end: float) -> np.ndarray:
        middles = np.arange(start, end, CELL) + CELL / 2
        return np.rint((middles + half_width(heights)) / GRID_SPACING).astype(int)

    left, right, low, high = VIEW
    seen = heights[np.ix_(indices(low, high), indices(left, right))]
    return np.rint(100 * seen).astype(int).ravel().tolist()


def _knob(name: str) -> Knob:
    return next(knob for knob in KNOBS if knob.name == name)


def _knob_json(knob: Knob) -> dict[str, Any]:
    """A knob as JSON types, with its values in its unit."""
    shown = [round(knob.shown * value, 6) for value in knob.values]
    return knob._asdict() | {"shown": shown, "start": knob.values.index(knob.start)}


def _bodies(robots: list[Robot]) -> list[list[dict[str, Any]]]:
    """What is drawn of each robot, with held and with free struts.

    `heave` tells the heave of the axles from the travel of the struts.
    """

    def drawn(robot: Robot, brakes: bool) -> dict[str, Any]:
        heave = heave_curves(robot, brakes)
        return {"skeleton": rover_skeleton(robot, brakes), "heave": heave}

    return [[drawn(robot, brakes) for brakes in BRAKES] for robot in robots]


def contents() -> dict[str, Any]:
    """All that explorer.js needs beside the rides, as JSON types."""
    names = list(PAPER_ROBOTS)
    stops = [
        BODY.replace(travel_lower=lower, travel_upper=upper)
        for lower, upper in itertools.product(*(knob.values for knob in STOPS))
    ]
    return {
        "who": WHO,
        "knobs": [_knob_json(knob) for knob in KNOBS],
        "setUp": len(SET_UP),
        "weaving": DRIVE[1].values.index(WEAVING),
        "body": dataclasses.asdict(BODY),
        "robots": [
            dataclasses.asdict(robot) | {"name": system_label(name)}
            for name, robot in PAPER_ROBOTS.items()
        ],
        "pairs": {
            words: [names.index(name) for name in pair] for words, pair in PAIRS.items()
        },
        "twins": [twin_name(spring) for spring in SPRINGS],
        "rows": [row._asdict() for row in comparison.ROWS],
        "measures": comparison.MEASURES,
        "struts": STRUTS,
        "held": comparison.HELD,
        "near": comparison.NEAR,
        "channels": CHANNELS,
        "gone": GONE,
        "moments": SAMPLES,
        "step": SAMPLE_TIME,
        "view": [*VIEW, CELL],
        "grounds": [_ground(scale) for scale in _knob("roughness").values],
        "charts": charts(),
        "colours": COLOURS,
        "bodies": _bodies(stops),
        "robotBodies": _bodies(list(PAPER_ROBOTS.values())),
    }


def pieces(rides: Sequence[bytes], scenes: Path) -> Iterator[tuple[str, Any]]:
    """Name and content, of JSON types, of the pieces that pages load when needed.

    They are scenes, the drives of one robot with held or free struts, and grounds.
    """
    for path in sorted(scenes.glob("scene-*.json")):
        yield path.stem, json.loads(path.read_text(encoding="utf-8"))
    for number, packed in enumerate(rides):
        yield f"rides-{number}", text(packed)
    left, right, low, high = REPLAYED
    corners = np.array([[left, low], [right, high]])
    for number, roughness in enumerate(_knob("roughness").values):
        whole = Ground(ground(roughness), GRID_SPACING)
        yield f"ground-{number}", ground_json(cropped(whole, corners, margin=0.0))


def write(folder: Path, rides: Sequence[bytes], scenes: Path = FOLDER) -> None:
    """Write the page's scripts: vega.js, data.js, the replay's, and the pieces."""
    folder.mkdir(parents=True, exist_ok=True)

    def put(name: str, script: str) -> None:
        (folder / name).write_text(script, encoding="utf-8")

    vega = vl_convert.javascript_bundle("window.vegaEmbed = vegaEmbed;")
    # in a function: scripts of the theme use some of its names, too
    put("vega.js", f"(() => {{{vega}}})();\n")
    data = json.dumps(contents(), separators=(",", ":"))
    put("data.js", f"window.explorerData = {data};\n")
    for name in (*SCRIPTS, STYLE):
        put(name, static(name))
    for name, piece in pieces(rides, scenes):
        content = json.dumps(piece, separators=(",", ":"))
        put(f"{name}.js", f'window.sidmPieces["{name}"]({content});\n')
