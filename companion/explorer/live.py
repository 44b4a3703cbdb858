"""The explorer with a Python kernel: sliders that simulate two robots side by side."""

from __future__ import annotations

import atexit
import base64
import contextlib
import functools
from concurrent.futures import Executor, Future
from typing import Any

from companion.explorer.views import picture, rides_figure
from sidm.pool import process_pool
from sidm.replay.rides import ROBOTS, Ride, find_robot, ride
from sidm.replay.viewer import replay
from sidm.systems import Robot, Terrain

SET_UP = ("spring", "damping", "travel_lower")  # fields of Robot that sliders change
#: Heights on each side of the ground, 20 m. No ride goes farther, and such a ground is
#: built in a third of the time that a recorded one takes.
SIZE = 201


@functools.lru_cache(maxsize=64)
def _cached_ride(
    robot: Robot, roughness: float, seed: int, throttle: float, steps: int, motors: bool
) -> Ride:
    """A ride, simulated only once for the same settings."""
    ground = Terrain(cell_height_scale=roughness, size=SIZE)
    return ride(robot, ground, seed, throttle, steps=steps, strut_motors=motors)


@functools.cache
def helper_process() -> tuple[Executor, Future]:
    """A process for the second ride, so that two rides take no longer than one.

    Returns:
        The process, and its first result, which is done as soon as the process runs.
    """
    stack = contextlib.ExitStack()
    atexit.register(stack.close)
    process = stack.enter_context(process_pool(1))
    return process, process.submit(find_robot, next(iter(ROBOTS)))


def both_rides(first: Robot, second: Robot, *settings: Any) -> tuple[Ride, Ride]:
    """The rides of two robots with the same settings.

    Args:
        first: parameters of the first robot.
        second: parameters of the second robot.
        *settings: roughness, terrain seed, throttle, steps and motors.
    """
    process, ready = helper_process()
    if not ready.done():
        return _cached_ride(first, *settings), _cached_ride(second, *settings)
    other = process.submit(_cached_ride, second, *settings)
    return _cached_ride(first, *settings), other.result()


def explorer(
    first: str = "system1 novice", second: str = "system1 expert", steps: int = 25
) -> Any:
    """Sliders for the set-up of one robot beside another, unchanged robot.

    Args:
        first: the robot of ROBOTS that the sliders start from.
        second: the robot of ROBOTS that it is compared with.
        steps: control steps of a ride.

    Returns:
        An ipywidgets box with the controls, which can also choose both robots, the
        picture, and the rides in three dimensions.

    Raises:
        ConfigError: there is no such robot.
    """
    import ipywidgets as widgets

    find_robot(first), find_robot(second)
    robots, knobs, moving = _controls(widgets, first, second)
    screen = widgets.Image(format="png")
    film = widgets.HTML(layout=widgets.Layout(width="100%"))
    setting_up = False

    def show(_: Any = None) -> None:
        if setting_up:
            return
        value = {name: knob.value for name, knob in knobs.items()}
        set_up = {name: value[name] for name in SET_UP}
        yours = find_robot(robots["first"].value).replace(**set_up)
        other = robots["second"].value
        drive = (value["roughness"], value["terrain_seed"], value["throttle"], steps)
        pair = both_rides(yours, find_robot(other), *drive, value["strut_motors"])
        rides = dict(zip(("yours", other), pair, strict=True))
        screen.value = picture(rides_figure(rides))
        film.value = replay(rides)._repr_html_() if moving.value else ""

    def start(_: Any = None) -> None:
        """Set the sliders to the first robot's values, and draw once."""
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
    row = widgets.Layout(flex_flow="row wrap")
    return widgets.HBox([controls, screen, film], layout=row)


def _controls(widgets: Any, first: str, second: str) -> tuple[dict, dict, Any]:
    """The controls of the explorer.

    Returns:
        The choices of the two robots by 'first' and 'second', the sliders by setting,
        and the button that shows the rides in three dimensions.
    """
    wide: dict[str, Any] = {
        "style": {"description_width": "13em"},
        "layout": widgets.Layout(width="31em"),
    }

    def choice(robot: str, description: str) -> Any:
        return widgets.Dropdown(
            options=list({**ROBOTS, robot: None}),
            value=robot,
            description=description,
            **wide,
        )

    def slider(description: str, start: float = 0.0, **values: Any) -> Any:
        return widgets.FloatSlider(
            start, description=description, continuous_update=False, **values, **wide
        )

    robots = {
        "first": choice(first, "your robot starts as"),
        "second": choice(second, "compared with"),
    }
    knobs = {
        "spring": widgets.FloatLogSlider(
            min=1.5, max=5, description="spring (N/m)", continuous_update=False, **wide
        ),
        "damping": slider("damping (N s/m)", min=0, max=200),
        "travel_lower": slider(
            "longest extension (m)",
            min=-0.03,
            max=-0.002,
            step=0.001,
            readout_format=".3f",
        ),
        "throttle": slider("throttle", 0.5, min=-1, max=1, step=0.05),
        "roughness": slider("rock height scale (m)", 0.35, min=0, max=0.9, step=0.05),
        "terrain_seed": widgets.IntSlider(
            0, min=0, max=20, description="terrain", continuous_update=False, **wide
        ),
        "strut_motors": widgets.Checkbox(
            True, description="joint motors hold the struts, as recorded", **wide
        ),
    }
    moving = widgets.ToggleButton(
        description="see them drive", tooltip="the rides in three dimensions"
    )
    return robots, knobs, moving


def with_picture(box: Any) -> dict[str, Any]:
    """An explorer by MIME types, with its picture for pages without a kernel.

    It is meant for `display(..., raw=True)`.
    """
    png = base64.b64encode(box.children[1].value).decode()
    return box._repr_mimebundle_() | {"image/png": png}
