"""The explorer with a Python kernel: sliders that simulate two robots side by side."""

from __future__ import annotations

import atexit
import base64
import contextlib
import functools
import html
from concurrent.futures import Executor, Future
from typing import Any

import ipywidgets as widgets

from companion.explorer.comparison import in_words, table_html
from companion.explorer.grid import PAIRS, SPRINGS, twin_name
from companion.explorer.views import picture, rides_figure
from companion.figures.style import system_label
from ownrobot.replay.rides import ROBOTS, Ride, find_robot, ride
from ownrobot.replay.viewer import replay
from sidm.pool import process_pool
from sidm.systems import Robot, Terrain

#: Fields of Robot that sliders change -> the slider's units in one of the field's.
SET_UP = {"spring": 1, "damping": 1, "travel_lower": 1000, "travel_upper": 1000}
#: Heights on each side of the ground, 20 m. No ride goes farther, and such a ground is
#: built in a third of the time that a recorded one takes.
SIZE = 201
YOURS = "your robot"
ALT = (
    "Height of the body, tilt, travel of the struts between their stops and path over "
    "the ground: {} solid, {} dashed"
)
#: of what the widgets show as HTML
LOOK = """<style>
.explorer-words { line-height: 1.4; max-width: 34rem; }
.explorer-words table { border-collapse: collapse; }
.explorer-words :is(th, td) { padding-right: 0.8em; text-align: left; }
.explorer-words [scope="row"] { font-weight: normal; }
</style>"""


@functools.lru_cache(maxsize=64)
def _cached_ride(
    robot: Robot, roughness: float, seed: int, throttle: float, steps: int, motors: bool
) -> Ride:
    ground = Terrain(cell_height_scale=roughness, size=SIZE)
    return ride(robot, ground, seed, throttle, steps=steps, strut_motors=motors)


@functools.cache
def helper_process() -> tuple[Executor, Future]:
    """A process for the second ride, so that two rides take no longer than one.

    Its first result is done as soon as the process runs.
    """
    stack = contextlib.ExitStack()
    atexit.register(stack.close)
    process = stack.enter_context(process_pool(1))
    return process, process.submit(find_robot, next(iter(ROBOTS)))


def both_rides(first: Robot, second: Robot, *settings: Any) -> tuple[Ride, Ride]:
    """The rides of two robots with the same settings, those of `_cached_ride`."""
    process, ready = helper_process()
    if not ready.done():
        return _cached_ride(first, *settings), _cached_ride(second, *settings)
    other = process.submit(_cached_ride, second, *settings)
    return _cached_ride(first, *settings), other.result()


def softer(robot: Robot) -> float:
    """The next softer of SPRINGS, N/m; the stiffest for a robot with the softest."""
    return max((one for one in SPRINGS if one < robot.spring), default=SPRINGS[-1])


def explorer(
    first: str = "system1 novice", second: str | None = None, steps: int = 25
) -> widgets.HBox:
    """Sliders for the suspension of one robot beside another one.

    The box has the controls, both robots in words, the picture, and the rides in three
    dimensions. The robots are names of ROBOTS, else there is a ConfigError; by default
    the second is the first's twin with a softer spring.
    """
    softer_twin = softer(find_robot(first))
    find_robot(second or first)
    controls, robots, knobs, buttons = _controls(first, second or softer_twin)
    words = widgets.HTML(layout={"flex": "1 1 24em"})  # beside the controls, or below
    screen, film = (widgets.HTML(layout={"width": "100%"}) for _ in range(2))
    pair, *_ = sorted(PAIRS.values(), key=lambda names: first not in names)
    setting_up = False

    def yours() -> Robot:
        set_up = {name: knobs[name].value / scale for name, scale in SET_UP.items()}
        return find_robot(robots["first"].value).replace(**set_up)

    def other() -> Robot:
        chosen = robots["second"].value
        if isinstance(chosen, str):
            return find_robot(chosen)
        return yours().replace(spring=chosen)

    def show(_: Any = None, scroll: bool = False) -> None:
        """Simulate and draw both robots, unless sliders are being set."""
        if setting_up:
            return
        start, chosen = (choice.value for choice in robots.values())
        names = [
            start if yours() == find_robot(start) else YOURS,
            chosen if isinstance(chosen, str) else twin_name(chosen),
        ]
        if names[0] == names[1]:
            names[1] = "the same robot"
        drive = ("roughness", "terrain_seed", "throttle")
        settings = [*(knobs[name].value for name in drive), steps]
        rides = both_rides(yours(), other(), *settings, knobs["strut_motors"].value)
        labels = [system_label(name) for name in names]
        by_label = dict(zip(labels, rides, strict=True))
        told = f'<p role="status">{html.escape(in_words(by_label))}</p>'
        table = table_html(by_label)
        words.value = f'{LOOK}<div class="explorer-words">{told}{table}</div>'
        png = picture(rides_figure(dict(zip(names, rides, strict=True))))
        # `widgets.Image` has no alternative text
        look = f'alt="{html.escape(ALT.format(*labels))}" style="max-width: 100%"'
        content = base64.b64encode(png).decode()
        screen.value = f'<img {look} src="data:image/png;base64,{content}">'
        film.value = _film(by_label, scroll) if buttons["drive"].value else ""

    def take(robot: Robot, **chosen: Any) -> None:
        """Set the sliders to a robot's suspension, and draw once."""
        nonlocal setting_up
        setting_up = True
        for name, value in chosen.items():
            robots[name].value = value
        for name, scale in SET_UP.items():
            knobs[name].value = scale * getattr(robot, name)
        setting_up = False
        show()

    def start(_: Any = None) -> None:
        if not setting_up:
            take(find_robot(robots["first"].value))

    def choose(names: tuple[str, ...]) -> None:
        nonlocal pair
        pair = names
        take(find_robot(names[0]), first=names[0], second=names[1])

    def only_springs(_: Any) -> None:
        novice, expert = pair
        take(find_robot(novice), first=novice, second=find_robot(expert).spring)

    start()
    robots["first"].observe(start, names="value")
    for knob in (robots["second"], *knobs.values()):
        knob.observe(show, names="value")
    buttons["drive"].observe(lambda _: show(scroll=True), names="value")
    buttons["take"].on_click(lambda _: take(other()))
    for words_on_it, names in PAIRS.items():
        buttons[words_on_it].on_click(lambda _, names=names: choose(names))
    buttons["springs"].on_click(only_springs)
    row = {"flex_flow": "row wrap"}
    return widgets.HBox([controls, words, screen, film], layout=row)


def _film(rides: dict[str, Ride], scroll: bool) -> str:
    """Rides in three dimensions; the page may scroll there."""
    frame = replay(rides)._repr_html_()
    seen = "<iframe onload=\"this.scrollIntoView({block: 'nearest'})\""
    return frame.replace("<iframe", seen, 1) if scroll else frame


Controls = dict[str, Any]


def _controls(
    first: str, second: str | float
) -> tuple[widgets.VBox, Controls, Controls, Controls]:
    """The controls of the explorer: the box, choices of robots, sliders and buttons.

    The choices are 'first' and 'second'; the sliders have the names of settings; the
    buttons are 'drive', 'take', 'springs' and the names of PAIRS.
    """
    wide: dict[str, Any] = {
        "style": {"description_width": "15em"},
        "layout": {"width": "33em", "max_width": "100%"},
    }

    def slider(description: str, kind: str = "Float", **values: Any) -> Any:
        look = {"description": description, "continuous_update": False} | wide
        return getattr(widgets, f"{kind}Slider")(**look, **values)

    def millimetres(description: str, least: float, most: float) -> Any:
        return slider(description, min=least, max=most, step=1, readout_format=",.0f")

    def button(description: str) -> Any:
        look = {"width": "auto", "align_self": "flex-start"}
        return widgets.Button(description=description, layout=look)

    others = [name for name in (first, second) if isinstance(name, str)]
    named = [(system_label(name), name) for name in dict.fromkeys([*ROBOTS, *others])]
    twins = [(twin_name(spring), spring) for spring in SPRINGS]
    robots = {
        name: widgets.Dropdown(
            options=options, value=value, description=description, **wide
        )
        for name, options, value, description in (
            ("first", named, first, "your robot starts as"),
            ("second", named + twins, second, "compared with"),
        )
    }
    whole: dict[str, Any] = {"readout_format": ",.0f"}
    knobs = {
        "spring": slider("spring (N/m)", "FloatLog", min=1.5, max=5, **whole),
        "damping": slider("damping (N s/m)", min=0, max=200, **whole),
        "travel_lower": millimetres("longest extension (mm)", -30, -2),
        "travel_upper": millimetres("deepest compression (mm)", 0, 10),
        "throttle": slider("throttle", value=0.5, min=-1, max=1, step=0.05),
        "roughness": slider(
            "rock height scale (m)", value=0.35, min=0, max=0.9, step=0.05
        ),
        "terrain_seed": slider("terrain", "Int", min=0, max=20),
        "strut_motors": widgets.Checkbox(
            True, description="joint motors hold the struts", indent=False
        ),
    }
    buttons = {
        **{words: button(words) for words in PAIRS},
        "springs": button("only the springs"),
        "take": button("take its springs, dampers and travel"),
        "drive": widgets.ToggleButton(
            description="see them drive", tooltip="the rides in three dimensions"
        ),
    }
    presets = widgets.HBox([*map(buttons.get, PAIRS), buttons["springs"]])
    box = [presets, *robots.values(), buttons["take"], *knobs.values()]
    return widgets.VBox([*box, buttons["drive"]]), robots, knobs, buttons


def with_picture(box: Any) -> dict[str, Any]:
    """An explorer by MIME types for `display(..., raw=True)`, with its picture."""
    png = box.children[2].value.partition("base64,")[2].partition('"')[0]
    return box._repr_mimebundle_() | {"image/png": png}
