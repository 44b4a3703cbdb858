"""Figures and the table of the chapter on the robots, and what it changes in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from companion.figures.style import system_label
from companion.pages.markdown import markdown_table
from ownrobot.plots import WIDTH, styled
from ownrobot.replay.rides import Ride, find_robot, tilt
from sidm.systems import ROLES, Robot, System
from sidm.terrain import generate_terrain

#: Field of a robot -> what it is, with its unit.
FIELDS = {
    "throttle_scale": "wheel speed at full throttle (rad/s)",
    "steering_scale": "wheel angle at full steering (rad)",
    "spring_offset": "rest of the spring, compression positive (m)",
    "travel_lower": "longest extension (m)",
    "travel_upper": "deepest compression (m)",
    "damping": "damping (N s/m)",
    "spring": "spring (N/m)",
    "friction": "friction of the tyres (-)",
    "mass_scale": "factor on all masses but the chassis's (-)",
}
START_YAW = 0.5  # rad
STEERING = 0.2  # of full steering

#: Field of a robot that the chapter's parameters change -> words for its value.
SUSPENSION = {
    "spring": "spring of {:g} N/m",
    "damping": "damping of {:g} N s/m",
    "travel_upper": "compression up to {:g} m",
    "travel_lower": "extension down to {:g} m",
}
GEARING = ("throttle_scale", "steering_scale")
SOFTER = 500  # times softer is the soft spring
#: Colours of changes to more than the suspension, and to the suspension alone: neutral,
#: since colours are those of methods.
COLOURS = "#1A1A1A", "#7A7A7A"


@styled
def robots_figure(
    pairs: Sequence[System], terrain_seed: int, throttle: float, steps: int
) -> Figure:
    """Pictures of both robots of each pair after a short drive on their own ground."""
    from sidm.simulation import Simulator  # PyBullet, which the rest does without

    figure = plt.figure(figsize=(WIDTH, 2.8 * len(pairs)), layout="constrained")
    panels = iter(figure.subplots(len(pairs), 2).flat)
    for pair in pairs:
        heights = generate_terrain(pair.terrain, terrain_seed)
        for role, panel in zip(ROLES, panels, strict=False):
            robot = pair.robot(role)
            with Simulator(robot, heights, pair.physics, visible=True) as simulator:
                simulator.reset(0.0, 0.0, START_YAW)
                for _ in range(steps):
                    simulator.step(np.array([throttle, STEERING]))
                panel.imshow(simulator.picture(distance=1.2))
            name = f"{system_label(pair.name)}, {role}"
            title = f"{name}: springs of {robot.spring:,.0f} N/m"
            panel.axis("off")
            panel.set_title(title, color="0.46")  # is read on white and on black
    figure.set_facecolor("none")
    return figure


def robots_table(pairs: Sequence[System]) -> str:
    """The values in which the robots of pairs differ, as a table in Markdown."""
    robots = {
        f"{system_label(pair.name)} {role}": pair.robot(role)
        for pair in pairs
        for role in ROLES
    }
    rows = [
        (
            f"{what}, `{field}`",
            *(f"{getattr(one, field):,g}" for one in robots.values()),
        )
        for field, what in FIELDS.items()
    ]
    return markdown_table(["", *robots], rows)


@styled
def grounds_figure(pairs: Sequence[System], terrain_seed: int) -> Figure:
    """The ground of each pair from above, in one scale of colours."""
    grounds = [generate_terrain(pair.terrain, terrain_seed) for pair in pairs]
    figure = plt.figure(figsize=(WIDTH, 3.5), layout="constrained")
    axes = figure.subplots(1, len(pairs), squeeze=False)[0]
    highest = max(float(heights.max()) for heights in grounds)
    for panel, pair, heights in zip(axes, pairs, grounds, strict=True):
        half = pair.terrain.half_width
        picture = panel.imshow(
            heights,
            origin="lower",
            extent=(-half, half, -half, half),
            cmap="cividis",
            vmin=0,
            vmax=highest,
        )
        panel.grid(False)
        panel.set(title=system_label(pair.name), xlabel="x (m)", ylabel="y (m)")
    figure.colorbar(picture, ax=list(axes), label="height (m)", shrink=0.8)
    return figure


class Change(NamedTuple):
    """A robot, and whether joint motors hold its struts."""

    robot: Robot
    motors: bool = True


def name_of(robot: str) -> str:
    """'system1 novice' in the text's words: "system 1's novice"."""
    return "{}'s {}".format(*system_label(robot).rsplit(" ", 1))


def given(values: Mapping[str, Any], which: str) -> dict[str, float]:
    """A suspension's values among a page's parameters, such as `first_spring`."""
    found = {field: values[f"{which}_{field}"] for field in SUSPENSION}
    return {field: value for field, value in found.items() if value is not None}


def changes_of(
    first: str,
    second: str,
    first_given: Mapping[str, float],
    second_given: Mapping[str, float],
) -> tuple[dict[str, Change], dict[str, Change]]:
    """What the chapter changes of its first robot, by words.

    Robots have names such as 'system1 novice', and the values of a suspension that a
    reader gives them. Changes of more than the suspension come first, then those of the
    suspension alone.
    """
    one, other = find_robot(first), find_robot(second)
    struts = {name: getattr(one, name) for name in ("spring_offset", *SUSPENSION)}
    gears = {name: getattr(other, name) for name in GEARING}
    robots = {
        f"{name_of(second)} instead": Change(other),
        f"{name_of(second)}\nwith the first robot's suspension": Change(
            other.replace(**struts)
        ),
        f"{name_of(first)}\nwith the second robot's gearing": Change(
            one.replace(**gears)
        ),
    }
    if second_given:
        words = f"{name_of(second)}\nwith the suspension given"
        robots[words] = Change(other.replace(**second_given))
    soft = one.replace(spring=one.spring / SOFTER)
    suspensions = {
        f"spring {SOFTER} times softer": Change(soft),
        "struts free: no joint motors": Change(one, motors=False),
        "soft spring and free struts": Change(soft, motors=False),
    }
    for name, value in first_given.items():
        words = SUSPENSION[name].format(value)
        suspensions[words] = Change(one.replace(**{name: value}))
    if len(first_given) > 1:
        suspensions["all of these together"] = Change(one.replace(**first_given))
    return robots, suspensions


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


@styled
def changes_figure(
    rides: Mapping[str, Sequence[Ride]], unchanged: Sequence[Ride], robots: int
) -> Figure:
    """How far changes move a robot: a dot for each ground, and a bar for their mean.

    `rides` has, by change in words, the changed robot's ride on each ground,
    `unchanged` the robot's. The first `robots` changes are to more than the suspension.
    """
    size = WIDTH, 1.0 + 0.45 * len(rides)
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
    axes[1].set_xlabel("RMS difference (degrees)")
    axes[1].set_title("tilt on the way: pitch and roll")
    return figure
