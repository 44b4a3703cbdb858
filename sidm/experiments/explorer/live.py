"""The explorer with a kernel: sliders that simulate anew, two robots beside each other, as an ipywidgets box."""

from __future__ import annotations

import base64
import functools
from typing import Any

from sidm.experiments.explorer.rides import ROBOTS, Ride, find_robot, ride
from sidm.experiments.explorer.views import picture, rides_figure
from sidm.systems import Robot, Terrain

SET_UP = ("spring", "damping", "travel_lower")  # what the sliders change of a robot


@functools.lru_cache(maxsize=64)
def _remembered(robot: Robot, roughness: float, seed: int, throttle: float, steps: int, motors: bool) -> Ride:
    """A ride, simulated once: what a slider leaves alone is not simulated again."""
    return ride(robot, Terrain(cell_height_scale=roughness), seed, throttle, steps=steps, strut_motors=motors)


def explorer(first: str = "system1 novice", second: str = "system1 expert", steps: int = 40) -> Any:
    """Sliders for the set-up of one robot beside an unchanged other one, both to be chosen, as an ipywidgets box.

    Args:
        first: the robot of ROBOTS that the sliders start from.
        second: the robot of ROBOTS it is compared with.
        steps: control steps of a ride.

    Raises:
        ConfigError: there is no such robot.
    """
    import ipywidgets as widgets

    wide = {"style": {"description_width": "13em"}, "layout": widgets.Layout(width="31em")}
    slow = wide | {"continuous_update": False}
    find_robot(first), find_robot(second)
    robots = {
        "first": widgets.Dropdown(options=list(ROBOTS), value=first, description="your robot starts as", **wide),
        "second": widgets.Dropdown(options=list(ROBOTS), value=second, description="compared with", **wide),
    }
    knobs = {
        "spring": widgets.FloatLogSlider(min=1.5, max=5, description="spring (N/m)", **slow),
        "damping": widgets.FloatSlider(min=0, max=200, description="damping (N s/m)", **slow),
        "travel_lower": widgets.FloatSlider(
            min=-0.03, max=-0.002, step=0.001, readout_format=".3f", description="longest extension (m)", **slow
        ),
        "throttle": widgets.FloatSlider(0.5, min=-1, max=1, step=0.05, description="throttle", **slow),
        "roughness": widgets.FloatSlider(0.35, min=0, max=0.9, step=0.05, description="rock height scale (m)", **slow),
        "terrain_seed": widgets.IntSlider(0, min=0, max=20, description="terrain", **slow),
        "strut_motors": widgets.Checkbox(True, description="struts braked, as recorded", **wide),
    }
    screen = widgets.Image(format="png")
    setting_up = False

    def show(_: Any = None) -> None:
        if setting_up:
            return
        value = {name: knob.value for name, knob in knobs.items()}
        other = robots["second"].value
        own = find_robot(robots["first"].value).replace(**{name: value[name] for name in SET_UP})
        same = value["roughness"], value["terrain_seed"], value["throttle"], steps, value["strut_motors"]
        rides = {"yours": _remembered(own, *same), other: _remembered(find_robot(other), *same)}
        screen.value = picture(rides_figure(rides))

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
    for knob in (robots["second"], *knobs.values()):
        knob.observe(show, names="value")
    return widgets.HBox([widgets.VBox([*robots.values(), *knobs.values()]), screen])


def with_picture(box: Any) -> dict[str, Any]:
    """For `display(..., raw=True)`: an explorer by MIME types, with its picture for where no kernel runs."""
    return box._repr_mimebundle_() | {"image/png": base64.b64encode(box.children[-1].value).decode()}
