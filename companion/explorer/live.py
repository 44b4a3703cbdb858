"""The explorer with a kernel: sliders that simulate anew, two robots beside each other, as an ipywidgets box."""

from __future__ import annotations

import atexit
import base64
import contextlib
import functools
from concurrent.futures import Executor, Future
from typing import Any

from companion.explorer.views import picture, rides_figure
from sidm.pool import local_pool
from sidm.replay.rides import ROBOTS, Ride, find_robot, ride
from sidm.replay.viewer import replay
from sidm.systems import Robot, Terrain

SET_UP = ("spring", "damping", "travel_lower")  # what the sliders change of a robot
#: heights a side, 20 m: as far as a ride goes, and built in a third of the time of a
#: recorded ground
SIZE = 201


@functools.lru_cache(maxsize=64)
def _remembered(
    robot: Robot, roughness: float, seed: int, throttle: float, steps: int, motors: bool
) -> Ride:
    """A ride, simulated once: what a slider leaves alone is not simulated again."""
    ground = Terrain(cell_height_scale=roughness, size=SIZE)
    return ride(robot, ground, seed, throttle, steps=steps, strut_motors=motors)


@functools.cache
def helper() -> tuple[Executor, Future]:
    """A process for the second ride, so that both take the time of one; and its first answer, to know that it runs."""
    stack = contextlib.ExitStack()
    atexit.register(stack.close)
    process = stack.enter_context(local_pool(1))
    return process, process.submit(find_robot, next(iter(ROBOTS)))


def both_rides(first: Robot, second: Robot, *same: Any) -> tuple[Ride, Ride]:
    """The rides of two robots with the `same` roughness, terrain seed, throttle, steps and motors."""
    process, ready = helper()
    if not ready.done():
        return _remembered(first, *same), _remembered(second, *same)
    other = process.submit(_remembered, second, *same)
    return _remembered(first, *same), other.result()


def explorer(
    first: str = "system1 novice", second: str = "system1 expert", steps: int = 25
) -> Any:
    """Sliders for the set-up of one robot beside an unchanged other one, both to be chosen, as an ipywidgets box.

    Args:
        first: the robot of ROBOTS that the sliders start from.
        second: the robot of ROBOTS it is compared with.
        steps: control steps of a ride.

    Raises:
        ConfigError: there is no such robot.
    """
    import ipywidgets as widgets

    wide = {
        "style": {"description_width": "13em"},
        "layout": widgets.Layout(width="31em"),
    }
    slow = wide | {"continuous_update": False}
    find_robot(first), find_robot(second)
    robots = {
        "first": widgets.Dropdown(
            options=list(ROBOTS),
            value=first,
            description="your robot starts as",
            **wide,
        ),
        "second": widgets.Dropdown(
            options=list(ROBOTS), value=second, description="compared with", **wide
        ),
    }
    knobs = {
        "spring": widgets.FloatLogSlider(
            min=1.5, max=5, description="spring (N/m)", **slow
        ),
        "damping": widgets.FloatSlider(
            min=0, max=200, description="damping (N s/m)", **slow
        ),
        "travel_lower": widgets.FloatSlider(
            min=-0.03,
            max=-0.002,
            step=0.001,
            readout_format=".3f",
            description="longest extension (m)",
            **slow,
        ),
        "throttle": widgets.FloatSlider(
            0.5, min=-1, max=1, step=0.05, description="throttle", **slow
        ),
        "roughness": widgets.FloatSlider(
            0.35, min=0, max=0.9, step=0.05, description="rock height scale (m)", **slow
        ),
        "terrain_seed": widgets.IntSlider(
            0, min=0, max=20, description="terrain", **slow
        ),
        "strut_motors": widgets.Checkbox(
            True, description="joint motors hold the struts, as recorded", **wide
        ),
    }
    moving = widgets.ToggleButton(
        description="see them drive", tooltip="the rides in three dimensions"
    )
    screen = widgets.Image(format="png")
    film = widgets.HTML(layout=widgets.Layout(width="100%"))
    setting_up = False

    def show(_: Any = None) -> None:
        if setting_up:
            return
        value = {name: knob.value for name, knob in knobs.items()}
        other = robots["second"].value
        own = find_robot(robots["first"].value).replace(
            **{name: value[name] for name in SET_UP}
        )
        same = (
            value["roughness"],
            value["terrain_seed"],
            value["throttle"],
            steps,
            value["strut_motors"],
        )
        yours, others = both_rides(own, find_robot(other), *same)
        screen.value = picture(rides_figure({"yours": yours, other: others}))
        film.value = (
            replay({"yours": yours, other: others})._repr_html_()
            if moving.value
            else ""
        )

    def start(_: Any = None) -> None:
        """Put the sliders where the first robot has them, and draw once."""
        nonlocal setting_up
        setting_up, robot = True, find_robot(robots["first"].value)
        for name in SET_UP:
            knobs[name].value = getattr(robot, name)
        setting_up = False
        show()

    start()
    robots["first"].observe(start, names="value")
    for knob in (robots["second"], *knobs.values(), moving):
        knob.observe(show, names="value")
    controls = widgets.VBox([*robots.values(), *knobs.values(), moving])
    return widgets.HBox(
        [controls, screen, film], layout=widgets.Layout(flex_flow="row wrap")
    )


def with_picture(box: Any) -> dict[str, Any]:
    """For `display(..., raw=True)`: an explorer by MIME types, with its picture for where no kernel runs."""
    return box._repr_mimebundle_() | {
        "image/png": base64.b64encode(box.children[1].value).decode()
    }
