"""Rides as pictures: height, tilt, travel of the struts, and path over the ground."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.style import ROLE_STYLES, draw_ground, system_label
from ownrobot.plots import STYLE, WIDTH
from ownrobot.replay.rides import Ride, tilt
from sidm.drives import POSITION

#: Line styles of the first and the second robot, in the neutral colours of novice and
#: expert.
LINES = tuple(
    {"color": ROLE_STYLES[role]["color"], "linestyle": line}
    for role, line in (("novice", "-"), ("expert", "--"))
)
PALER = 0.45  # opacity of a robot's second line in a plot
MARGIN = 1.0  # m of ground shown around the paths
# Fixed margins: a slider's picture is drawn twice as fast as with automatic layout.
ROOM = {"left": 0.115, "right": 0.99, "bottom": 0.07, "top": 0.95}
ROOM |= {"wspace": 0.3, "hspace": 0.3}
STOP: dict[str, Any] = {"lw": 0.8, "color": "0.3", "linestyle": ":", "marker": ""}
SHAPE = 3.6  # width of the path's plot divided by its height
PLOTS: Any = [["height", "tilt"], ["front", "rear"], ["path", "path"]]
AXLES = {"rear": (0, 1), "front": (2, 3)}  # right and left strut


def rides_figure(rides: Mapping[str, Ride]) -> Figure:
    """Height, tilt, strut travel and path of up to two rides by label.

    The ground of the first ride is drawn under the paths.
    """
    with plt.style.context(STYLE):
        figure, plots = plt.subplot_mosaic(
            PLOTS, figsize=(WIDTH, 8.0), layout="none", gridspec_kw=ROOM
        )
        for (name, ride), line in zip(rides.items(), LINES, strict=False):
            _draw_ride(plots, system_label(name), ride, line | {"marker": ""})
        _set_ground(plots["path"], list(rides.values()))
        plots["height"].set(xlabel="time (s)", ylabel="height of the body (m)")
        plots["tilt"].set(xlabel="time (s)", ylabel="tilt (degrees)\npitch, roll paler")
        for axle in AXLES:
            label = f"{axle} struts (mm)\nright, left paler"
            plots[axle].set(xlabel="time (s)", ylabel=label)
        plots["path"].set(xlabel="x (m)", ylabel="y (m)")
        plots["front"].plot([], [], label="the struts' stops", **STOP)
        for axes in plots.values():
            axes.locator_params(nbins=5)  # a tick takes as long to draw as a line
        figure.legend(loc="upper center", ncols=len(LINES) + 1)
    plt.close(figure)
    return figure


def _draw_ride(
    plots: Mapping[str, Axes], name: str, ride: Ride, line: dict[str, Any]
) -> None:
    time, position = ride.times, ride.states[:, POSITION]
    plots["height"].plot(time, position[:, 2], label=name, **line)
    for angle, alpha in zip(tilt(ride.states), (1.0, PALER), strict=True):
        plots["tilt"].plot(time, angle, alpha=alpha, **line)
    for axle, struts in AXLES.items():
        for strut, alpha in zip(struts, (1.0, PALER), strict=True):
            travel = 1e3 * ride.struts[:, strut]
            plots[axle].plot(time, travel, alpha=alpha, **line)
        for stop in (ride.robot.travel_lower, ride.robot.travel_upper):
            plots[axle].axhline(1e3 * stop, **(STOP | {"color": line["color"]}))
    plots["path"].plot(position[:, 0], position[:, 1], **line)


def _set_ground(path: Axes, rides: Sequence[Ride]) -> None:
    """Draw the first ride's ground, higher darker, as far as the paths reach."""
    heights = rides[0].heights
    draw_ground(path, heights, 0.0, 2 * max(float(heights.max()), 0.1))
    places = np.concatenate([ride.states[:, :2] for ride in rides])
    middle = (places.max(0) + places.min(0)) / 2
    size = np.ptp(places, axis=0) + 2 * MARGIN
    reach = max(size[0], SHAPE * size[1]) / 2 * np.array([1, 1 / SHAPE])
    (left, low), (right, high) = middle - reach, middle + reach
    path.set(xlim=(left, right), ylim=(low, high), aspect="equal")


def picture(figure: Figure) -> bytes:
    """A figure as PNG, compressed little so that it is quickly written."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=100, pil_kwargs={"compress_level": 1})
    return file.getvalue()
