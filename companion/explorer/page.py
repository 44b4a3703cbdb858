"""The explorer's page: charts that Vega draws in the reader's browser, and the rides that its sliders choose from.

`write` puts scripts beside the page, so that nothing comes from another host: Vega
itself, the charts, the replay, and the rides in pieces that are loaded when they are
needed; book/static/explorer.js puts them together. Altair makes the charts and
vl-convert brings Vega's libraries.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import altair as alt
import numpy as np
import vl_convert

from companion.explorer.grid import (
    BODY,
    BRAKES,
    CHANNELS,
    DRIVE,
    FOLDER,
    GONE,
    KNOBS,
    MOMENTS,
    PAPERS,
    SET_UP,
    STEPS,
    WEAVING,
    Grid,
    Knob,
    ground,
)
from companion.explorer.views import LINES
from companion.figures.style import half_width
from sidm.drives import CONTROL_STEP, Ground
from sidm.replay.packing import text
from sidm.replay.rides import SAMPLE, STRUTS
from sidm.replay.scene_file import cropped, ground_json, read_scene, scene_json
from sidm.replay.skeleton import heave_curves, rover_skeleton
from sidm.replay.viewer import SCRIPTS, STYLE, static
from sidm.systems import GRID_SPACING, Robot

WHO = ("your robot", "the robot named")
#: left, right, low and high of the ground that is shown, m
VIEW = (-1.5, 14.5, -5.0, 5.0)
REPLAYED = (-4.0, 14.9, -9.0, 9.0)  # the same of the replay's
CELL = 0.4  # side of a piece of ground that is drawn, m
TALLEST = 2.0  # height of the darkest ground, m


def _lines() -> alt.Chart:
    """Lines of both robots, told apart by colour and dashes."""
    looks = {"domain": list(WHO), "range": [line["color"] for line in LINES]}
    return (
        alt.Chart(alt.NamedData(name="ride"))
        .mark_line(clip=True)
        .encode(
            color=alt.Color("who:N", scale=alt.Scale(**looks), legend=None),
            strokeDash=alt.StrokeDash(
                "who:N",
                scale=alt.Scale(domain=list(WHO), range=[[1, 0], [6, 3]]),
                legend=None,
            ),
            order="t:Q",
        )
    )


def _over_time(title: str, **scale: Any) -> alt.Chart:
    """A value `v` against time."""
    time = alt.X(
        "t:Q",
        title="time (s)",
        scale=alt.Scale(domain=[0, CONTROL_STEP * STEPS], nice=False),
    )
    return _lines().encode(
        x=time, y=alt.Y("v:Q", title=title, scale=alt.Scale(zero=False, **scale))
    )


def _travel() -> alt.LayerChart:
    """A strut's travel between its stops."""
    low = min(
        value for knob in SET_UP if knob.name == "travel_lower" for value in knob.values
    )
    lines = _over_time("travel (mm)", domain=[1e3 * low - 2, 6], nice=False)
    stops = (
        alt.Chart(alt.NamedData(name="stops"))
        .mark_rule(strokeDash=[2, 3])
        .encode(y="v:Q", color=alt.Color("who:N", legend=None))
    )
    return lines + stops


def _path() -> alt.LayerChart:
    """The paths over the ground, from above."""
    left, right, low, high = VIEW
    x = alt.X("x:Q", title="x (m)", scale=alt.Scale(domain=[left, right], nice=False))
    y = alt.Y("y:Q", title="y (m)", scale=alt.Scale(domain=[low, high], nice=False))
    pale = alt.Scale(domain=[0, TALLEST], range=["#ffffff", "#4d4d4d"], clamp=True)
    cells = (
        alt.Chart(alt.NamedData(name="ground"))
        .mark_rect()
        .encode(
            x=x,
            x2="x2:Q",
            y=y,
            y2="y2:Q",
            color=alt.Color("h:Q", scale=pale, legend=None),
        )
    )
    return (cells + _lines().encode(x=x, y=y)).resolve_scale(color="independent")


def charts() -> dict[str, dict[str, Any]]:
    """Specifications of the charts by the name of what they show, in the order in which they stand."""
    made = {
        "height": (
            _over_time("height of the body (m)"),
            "Height of the body over time",
        ),
        "path": (_path(), "Paths from above, higher ground darker"),
        "pitch": (_over_time("pitch (degrees)"), "Pitch over time, nose down positive"),
        "roll": (
            _over_time("roll (degrees)"),
            "Roll over time, right side down positive",
        ),
    }
    for number in (3, 2, 1, 0):  # as they lie, seen from above
        words = f"{STRUTS[number].capitalize()} strut, stops dotted"
        made[f"strut {number}"] = _travel(), words
    return {
        name: chart.properties(
            width="container", height=180, title=words, description=words
        )
        .configure(background="white", font="sans-serif")
        .to_dict(validate=False)
        for name, (chart, words) in made.items()
    }


def _ground(roughness: float) -> list[int]:
    """Heights of the pieces of ground in VIEW, rows from low to high, cm."""
    heights = ground(roughness)
    left, right, low, high = VIEW
    across, up = (
        np.arange(start, end, CELL) + CELL / 2
        for start, end in ((left, right), (low, high))
    )
    rows, columns = (
        np.rint((at + half_width(heights)) / GRID_SPACING).astype(int)
        for at in (up, across)
    )
    return np.rint(100 * heights[np.ix_(rows, columns)]).astype(int).ravel().tolist()


def _knob(knob: Knob) -> dict[str, Any]:
    return {
        "name": knob.name,
        "label": knob.label,
        "unit": knob.unit,
        "shown": [round(knob.shown * value, 6) for value in knob.values],
        "start": knob.values.index(knob.start),
    }


def _set_up(name: str) -> dict[str, Any]:
    """Where the sliders stand for a robot, and its stops in mm."""
    robot = PAPERS[name]
    at = {knob.name: knob.values.index(getattr(robot, knob.name)) for knob in SET_UP}
    return {
        "name": name,
        "knobs": at,
        "stops": [1e3 * robot.travel_lower, 1e3 * robot.travel_upper],
    }


def _bodies(robots: list[Robot]) -> list[list[dict[str, Any]]]:
    """Of each robot, braked and free: what is drawn of it, and how its axles' heave follows from their struts."""
    return [
        [
            {
                "skeleton": rover_skeleton(one, brakes),
                "heave": heave_curves(one, brakes),
            }
            for brakes in BRAKES
        ]
        for one in robots
    ]


def contents() -> dict[str, Any]:
    """All that explorer.js needs beside the rides, of JSON types."""
    roughness = next(knob for knob in DRIVE if knob.name == "roughness")
    lowest = next(knob for knob in SET_UP if knob.name == "travel_lower")
    return {
        "who": WHO,
        "knobs": [_knob(knob) for knob in KNOBS],
        "setUp": len(SET_UP),
        "weaving": DRIVE[1].values.index(WEAVING),
        "robots": [_set_up(name) for name in PAPERS],
        "channels": CHANNELS,
        "ownUpperStop": 1e3 * BODY.travel_upper,
        "gone": GONE,
        "moments": MOMENTS,
        "step": SAMPLE,
        "view": [*VIEW, CELL],
        "grounds": [_ground(value) for value in roughness.values],
        "charts": charts(),
        "colours": [line["color"] for line in LINES],
        "bodies": _bodies(
            [BODY.replace(travel_lower=value) for value in lowest.values]
        ),
        "robotBodies": _bodies(list(PAPERS.values())),
    }


def pieces(grid: Grid, scenes: Path) -> Iterator[tuple[str, Any]]:
    """What the pages load when they need it, by name: the drives of one robot, braked or not, grounds, whole scenes."""
    for path in sorted(scenes.glob("scene-*.npz")):
        yield path.stem, scene_json(read_scene(path))
    for number, packed in enumerate(grid.packed):
        yield f"rides-{number}", text(packed)
    for number, roughness in enumerate(DRIVE[0].values):
        left, right, low, high = REPLAYED
        corners = np.array([[left, low], [right, high]])
        yield (
            f"ground-{number}",
            ground_json(
                cropped(Ground(ground(roughness), GRID_SPACING), corners, margin=0.0)
            ),
        )


def write(folder: Path, grid: Grid, scenes: Path = FOLDER) -> None:
    """Write vega.js, data.js, the replay's scripts and pieces into `folder`; `scenes` is the folder of its scenes."""
    folder.mkdir(parents=True, exist_ok=True)
    vega = vl_convert.javascript_bundle("window.vegaEmbed = vegaEmbed;")
    # its other names are names of the theme's scripts, too
    hidden = f"(() => {{{vega}}})();\n"
    (folder / "vega.js").write_text(hidden, encoding="utf-8")
    words = json.dumps(contents(), separators=(",", ":"))
    (folder / "data.js").write_text(
        f"window.explorerData = {words};\n", encoding="utf-8"
    )
    for name in (*SCRIPTS, STYLE):
        (folder / name).write_text(static(name), encoding="utf-8")
    for name, piece in pieces(grid, scenes):
        words = json.dumps(piece, separators=(",", ":"))
        (folder / f"{name}.js").write_text(
            f'window.sidmPieces["{name}"]({words});\n', encoding="utf-8"
        )
