"""The suspension under one's fingers: drive two robots over the same ground and see what their springs do."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from sidm.config import unknown_name
from sidm.experiments.drawing import CONTROL_STEP, STYLE
from sidm.systems import ROLES, SYSTEMS, Physics, Robot, Terrain
from sidm.terrain import generate_terrain
from sidm.trajectory import POSITION, QUATERNION

#: The paper's four robots, by the names the explorer's menu shows.
ROBOTS = {f"{system.name} {role}": system.robot(role) for system in SYSTEMS.values() for role in ROLES}
LINES = ({"color": "#0072B2", "linestyle": "-"}, {"color": "#D55E00", "linestyle": "--"})


def find_robot(name: str) -> Robot:
    """The robot of that name, as 'system1 novice'; ConfigError naming the nearest otherwise."""
    if name not in ROBOTS:
        raise unknown_name(name, ROBOTS, "the robots")
    return ROBOTS[name]


class Ride(NamedTuple):
    """T control steps of one robot under a held action."""

    robot: Robot
    states: np.ndarray  # (T + 1, 13)
    struts: np.ndarray  # (T + 1, 4), m: rear right, rear left, front right, front left


def ride(
    robot: Robot,
    terrain: Terrain,
    terrain_seed: int = 0,
    throttle: float = 0.5,
    steering: float = 0.0,
    steps: int = 40,
    strut_motors: bool = True,
) -> Ride:
    """Drive a robot from the origin along x.

    Args:
        robot: its parameters.
        terrain: the kind of ground.
        terrain_seed: which ground.
        throttle: held, in [-1, 1].
        steering: held, in [-1, 1].
        steps: control steps of 0.1 s.
        strut_motors: brake the struts as in the recorded robot; otherwise springs and dampers act alone.
    """
    from sidm.simulation import Simulator

    physics = Physics(strut_motors=strut_motors)
    with Simulator(robot, generate_terrain(terrain, terrain_seed), physics) as simulator:
        states, struts = [simulator.reset()], [simulator.strut_positions]
        for _ in range(steps):
            states.append(simulator.step(np.array([throttle, steering])))
            struts.append(simulator.strut_positions)
    return Ride(robot, np.array(states), np.array(struts))


def tilt(states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pitch (nose down positive) and roll (right side down positive), degrees, each (...,), of states (..., 13)."""
    x, y, z, w = np.moveaxis(states[..., QUATERNION], -1, 0)
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    return np.degrees(pitch), np.degrees(roll)


def rides_figure(rides: Mapping[str, Ride]) -> Figure:
    """Height, tilt, front strut travel with its stops, and path of up to two rides beside each other."""
    with plt.style.context(STYLE):
        figure, axes = plt.subplots(2, 2, figsize=(9.6, 6.2), layout="constrained")
        (height, angles), (travel, path) = axes
        for (name, one), line in zip(rides.items(), LINES, strict=False):
            time = CONTROL_STEP * np.arange(len(one.states))
            position = one.states[:, POSITION]
            pitch, roll = tilt(one.states)
            line = line | {"marker": ""}
            height.plot(time, position[:, 2], label=name, **line)
            angles.plot(time, pitch, label=f"{name}, pitch", **line)
            angles.plot(time, roll, label=f"{name}, roll", **line, alpha=0.5)
            for strut, alpha in ((2, 1.0), (3, 0.5)):
                side = "right" if strut == 2 else "left"
                travel.plot(time, 1e3 * one.struts[:, strut], label=f"{name}, {side}", **line, alpha=alpha)
            for stop in (one.robot.travel_lower, one.robot.travel_upper):
                travel.axhline(1e3 * stop, lw=0.8, color=line["color"], linestyle=":", marker="")
            path.plot(position[:, 0], position[:, 1], label=name, **line)
        height.set(xlabel="time (s)", ylabel="height of the body (m)")
        angles.set(xlabel="time (s)", ylabel="tilt (degrees)")
        travel.set(xlabel="time (s)", ylabel="front strut travel (mm)\ncompression positive, stops dotted")
        path.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", adjustable="datalim")
        for each in axes.flat:
            each.legend(fontsize="small")
    plt.close(figure)
    return figure


def picture(figure: Figure) -> bytes:
    """A figure as PNG."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=100)
    return file.getvalue()


def explorer(first: str = "system1 novice", second: str = "system1 expert", steps: int = 40) -> Any:
    """Sliders for the first robot's suspension beside an unchanged second one, as an ipywidgets box.

    Args:
        first: the robot of ROBOTS whose sliders are shown.
        second: the robot of ROBOTS it is compared with.
        steps: control steps of a ride.
    """
    import ipywidgets as widgets

    start, other = find_robot(first), find_robot(second)
    wide = {"style": {"description_width": "12em"}, "layout": widgets.Layout(width="30em"), "continuous_update": False}
    knobs = {
        "spring": widgets.FloatLogSlider(start.spring, min=1.5, max=5, description="spring (N/m)", **wide),
        "damping": widgets.FloatSlider(start.damping, min=0, max=200, description="damping (N s/m)", **wide),
        "travel_lower": widgets.FloatSlider(
            start.travel_lower,
            min=-0.03,
            max=-0.002,
            step=0.001,
            readout_format=".3f",
            description="travel (m)",
            **wide,
        ),
        "throttle": widgets.FloatSlider(0.5, min=-1, max=1, step=0.05, description="throttle", **wide),
        "roughness": widgets.FloatSlider(0.35, min=0, max=0.9, step=0.05, description="rock height scale (m)", **wide),
        "terrain_seed": widgets.IntSlider(0, min=0, max=20, description="terrain", **wide),
        "strut_motors": widgets.Checkbox(True, description="brake the struts, as in the recordings"),
    }
    screen = widgets.Image(format="png")

    def show(_: Any = None) -> None:
        value = {name: knob.value for name, knob in knobs.items()}
        terrain = Terrain(cell_height_scale=value["roughness"])
        own = start.replace(**{name: value[name] for name in ("spring", "damping", "travel_lower")})
        same = {key: value[key] for key in ("terrain_seed", "throttle", "strut_motors")}
        rides = {"yours": ride(own, terrain, steps=steps, **same)}
        rides[second] = ride(other, terrain, steps=steps, **same)
        screen.value = picture(rides_figure(rides))

    for knob in knobs.values():
        knob.observe(show, names="value")
    show()
    return widgets.VBox([*knobs.values(), screen])
