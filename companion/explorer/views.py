"""Rides as pictures: height, tilt, strut travel between its stops, and the path over the ground."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.style import lay_ground
from sidm.drives import POSITION
from sidm.plots import STYLE
from sidm.replay.rides import Ride, tilt

#: Of the first and the second robot.
LINES: tuple[dict[str, Any], ...] = (
    {"color": "#0072B2", "linestyle": "-"},
    {"color": "#D55E00", "linestyle": "--"},
)
PALER = 0.45  # opacity of the second line of a robot in a plot
MARGIN = 1.0  # m of ground shown around the paths
# Laid out by hand, which a slider's picture waits for half as long.
ROOM = {
    "left": 0.085,
    "right": 0.99,
    "bottom": 0.07,
    "top": 0.95,
    "wspace": 0.22,
    "hspace": 0.28,
}
STOP: dict[str, Any] = {"lw": 0.8, "color": "0.3", "linestyle": ":", "marker": ""}
SHAPE = 3.6  # width of the plot of the path by its height
PLOTS: Any = [["height", "tilt"], ["front", "rear"], ["path", "path"]]
AXLES = {"rear": (0, 1), "front": (2, 3)}  # right and left strut


def rides_figure(rides: Mapping[str, Ride]) -> Figure:
    """Height, tilt, strut travel with its stops, and path of up to two rides over the ground of the first."""
    with plt.style.context(STYLE):
        figure, plots = plt.subplot_mosaic(
            PLOTS, figsize=(9.6, 8.0), layout="none", gridspec_kw=ROOM
        )
        height, angles, path = plots["height"], plots["tilt"], plots["path"]
        for (name, one), line in zip(rides.items(), LINES, strict=False):
            time, position = one.times, one.states[:, POSITION]
            line = line | {"marker": ""}
            height.plot(time, position[:, 2], label=name, **line)
            for angle, alpha in zip(tilt(one.states), (1.0, PALER), strict=True):
                angles.plot(time, angle, alpha=alpha, **line)
            for axle, struts in AXLES.items():
                for strut, alpha in zip(struts, (1.0, PALER), strict=True):
                    plots[axle].plot(
                        time, 1e3 * one.struts[:, strut], alpha=alpha, **line
                    )
                for stop in (one.robot.travel_lower, one.robot.travel_upper):
                    plots[axle].axhline(1e3 * stop, **(STOP | {"color": line["color"]}))
            path.plot(position[:, 0], position[:, 1], **line)
        _lay_ground(path, list(rides.values()))
        height.set(xlabel="time (s)", ylabel="height of the body (m)")
        angles.set(xlabel="time (s)", ylabel="tilt (degrees)\npitch, roll paler")
        for axle in AXLES:
            plots[axle].set(
                xlabel="time (s)", ylabel=f"{axle} struts (mm)\nright, left paler"
            )
        path.set(xlabel="x (m)", ylabel="y (m)")
        plots["front"].plot([], [], label="the struts' stops", **STOP)
        for axes in plots.values():
            axes.locator_params(nbins=5)  # a tick takes as long to draw as a line
        figure.legend(loc="upper center", ncols=len(LINES) + 1)
    plt.close(figure)
    return figure


def _lay_ground(path: Axes, rides: Sequence[Ride]) -> None:
    """The first ride's ground under the paths, higher darker, as far as they go."""
    heights = rides[0].heights
    lay_ground(path, heights, 0.0, 2 * max(float(heights.max()), 0.1))
    gone = np.concatenate([one.states[:, :2] for one in rides])
    middle, size = (gone.max(0) + gone.min(0)) / 2, np.ptp(gone, axis=0) + 2 * MARGIN
    reach = max(size[0], SHAPE * size[1]) / 2 * np.array([1, 1 / SHAPE])
    (left, low), (right, high) = middle - reach, middle + reach
    path.set(xlim=(left, right), ylim=(low, high), aspect="equal")


def picture(figure: Figure) -> bytes:
    """A figure as PNG."""
    file = io.BytesIO()
    # quickly rather than small
    figure.savefig(file, format="png", dpi=100, pil_kwargs={"compress_level": 1})
    return file.getvalue()
