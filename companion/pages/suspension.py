"""What the chapter on the suspension measures, draws and says."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from ownrobot.replay.rides import Ride, tilt
from sidm.systems import Robot

#: Field of a robot that the chapter's parameters change -> words for its value.
SUSPENSION = {
    "spring": "spring of {:g} N/m",
    "damping": "damping of {:g} N s/m",
    "travel_upper": "compression up to {:g} m",
    "travel_lower": "extension down to {:g} m",
}
#: Colours of changes to more than the suspension, and to the suspension alone.
COLOURS = "#D55E00", "#0072B2"


def changed_robots(robot: Robot, values: Mapping[str, float]) -> dict[str, Robot]:
    """Copies of a robot with each of the values alone and with all, by their words."""
    copies = {
        SUSPENSION[name].format(value): robot.replace(**{name: value})
        for name, value in values.items()
    }
    if len(values) > 1:
        copies["all of these together"] = robot.replace(**values)
    return copies


def suspension_ratios(robot: Robot, other: Robot) -> tuple[float, float, float]:
    """A robot's spring, damping and travel, each divided by the other robot's."""
    return (
        _ratio(robot.spring, other.spring),
        _ratio(robot.damping, other.damping),
        _ratio(_travel(robot), _travel(other)),
    )


def _ratio(value: float, other: float) -> float:
    if math.isclose(value, other):
        return 1.0
    return value / other if other else math.inf


def _travel(robot: Robot) -> float:
    return robot.travel_upper - robot.travel_lower


def ratios_text(robot: Robot, other: Robot) -> str:
    """The ratios in words: 'spring 5 times, damping 2 times, travel the same'."""
    spring, damping, travel = suspension_ratios(robot, other)
    less = f"{1 / travel:.2g} times less" if travel < 1 else f"{travel:.2g} times more"
    words = "the same" if travel == 1 else less
    return f"spring {_times(spring)}, damping {_times(damping)}, travel {words}"


def _times(ratio: float) -> str:
    if ratio in (1, math.inf):
        return "the same" if ratio == 1 else "against none"
    return f"{ratio:.0f} times" if ratio >= 10 else f"{ratio:.2g} times"


def between_ends(rides: Sequence[Ride], others: Sequence[Ride]) -> np.ndarray:
    """Distance between the ends of two rides on each ground, m."""
    return np.linalg.norm(
        _states(rides)[:, -1, :2] - _states(others)[:, -1, :2], axis=1
    )


def between_tilts(rides: Sequence[Ride], others: Sequence[Ride]) -> np.ndarray:
    """Root mean square difference of pitch and roll on each ground, degrees."""
    difference = np.subtract(tilt(_states(rides)), tilt(_states(others)))
    return np.sqrt(np.mean(difference**2, axis=(0, 2)))


def _states(rides: Sequence[Ride]) -> np.ndarray:
    return np.array([ride.states for ride in rides])


def rear_travel(rides: Sequence[Ride]) -> float:
    """The largest travel of a rear strut, mm."""
    return 1e3 * max(np.ptp(ride.struts[:, :2], axis=0).max() for ride in rides)


def changes_figure(
    rides: Mapping[str, Sequence[Ride]], unchanged: Sequence[Ride], robots: int
) -> Figure:
    """How far changes move a robot: a dot for each ground, and a bar for their mean.

    `rides` has, by change in words, the changed robot's ride on each ground,
    `unchanged` the robot's. The first `robots` changes are to more than the suspension.
    """
    size = 9.6, 0.9 + 0.5 * len(rides)
    figure, axes = plt.subplots(1, 2, figsize=size, sharey=True, layout="constrained")
    dots: dict[str, Any] = {"linestyle": "", "marker": "o", "alpha": 0.5}
    bar: dict[str, Any] = {"linestyle": "", "marker": "|", "markersize": 22}
    for panel, between in zip(axes, (between_ends, between_tilts), strict=True):
        for row, changed in enumerate(rides.values()):
            colour, values = COLOURS[row >= robots], between(changed, unchanged)
            panel.plot(values, [row] * len(values), color=colour, **dots)
            panel.plot(values.mean(), row, color=colour, markeredgewidth=2.5, **bar)
        panel.set(yticks=range(len(rides)), yticklabels=list(rides))
        panel.set(xscale="log", ylim=(len(rides) - 0.5, -0.5))
        panel.xaxis.set_major_formatter("{x:g}")
    axes[0].set_xlabel("distance between the ends (m)")
    axes[0].set_title(f"position after {unchanged[0].times[-1]:g} s")
    axes[1].set_xlabel("root mean square difference (degrees)")
    axes[1].set_title("tilt on the way: pitch and roll")
    plt.close(figure)
    return figure
