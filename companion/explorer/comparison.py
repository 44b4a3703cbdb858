"""Two robots and their rides in numbers and words, for both explorers.

book/static/explorer.js says the same of the stored rides; a test compares them.
"""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ownrobot.replay.rides import STRUTS, Ride, tilt
from sidm.drives import POSITION
from sidm.systems import Robot

NEAR = 2e-4  # m, a strut nearer to a stop than this is at it
#: Struts of the rear. Joint motors hold them at 0 mm, where the upper stop may be: they
#: stand there without meeting it.
HELD = (0, 1)


class Row(NamedTuple):
    """A value of robots; two fields are the ends of a range."""

    label: str
    unit: str
    fields: tuple[str, ...]  # of Robot
    scale: float = 1.0  # units in an SI unit


ROWS = (
    Row("spring", "N/m", ("spring",)),
    Row("damping", "N s/m", ("damping",)),
    Row("travel", "mm", ("travel_lower", "travel_upper"), 1e3),
    Row("gearing: wheel speed at full throttle", "rad/s", ("throttle_scale",)),
    Row("gearing: angle at full steering", "rad", ("steering_scale",)),
    Row("rest position of the springs", "mm", ("spring_offset",), 1e3),
    Row("friction of the tyres", "", ("friction",)),
    Row("factor on the mass of axles and wheels", "", ("mass_scale",)),
)
SUSPENSION, GEARING = ROWS[:3], ROWS[3:5]
#: What is told of a ride.
MEASURES = (
    "distance from the start",
    "range of height",
    "range of pitch, roll",
    "most strut travel",
    "time at a stop",
)


def number(value: float) -> str:
    """A number of three decimals at most: '50,000' or '−0.5'."""
    return f"{value:,.3f}".rstrip("0").rstrip(".").replace("-", "−")


def ends(row: Row, robot: Robot) -> list[float]:
    """A robot's value, or both ends of its range, in the row's unit."""
    return [row.scale * getattr(robot, field) for field in row.fields]


def value_text(row: Row, robot: Robot) -> str:
    """A robot's value with its unit: '50,000 N/m' or '20 mm (−20 to 0)'."""
    low, *high = ends(row, robot)
    if not high:
        return f"{number(low)} {row.unit}".strip()
    range_text = f"({number(low)} to {number(high[0])})"
    return f"{number(high[0] - low)} {row.unit} {range_text}"


def times(name: str, first: float, second: float) -> str:
    """A ratio in the paper's words: '5 times the spring', '1.5 times less travel'."""
    if np.isclose(first, second):
        return f"the same {name}"
    if not first or not second:
        return f"no {name}" if second else f"{name}, which the other lacks"
    ratio = max(first, second) / min(first, second)
    words = f"{ratio:.{0 if ratio > 9.95 else 1}f}".removesuffix(".0")
    return f"{words} times {'the' if first > second else 'less'} {name}"


def robots_in_words(robots: Sequence[Robot], names: Sequence[str]) -> str:
    """How two robots differ: suspension as ratios, then gearing."""
    ratios = ", ".join(
        times(row.label, *(np.ptp([0.0, *ends(row, one)][-2:]) for one in robots))
        for row in SUSPENSION
    )
    gears = [[value_text(row, robot) for robot in robots] for row in GEARING]
    gearing = "The gearing is the same."
    if any(first != second for first, second in gears):
        wheels, angle = map(" against ".join, gears)
        gearing = (
            "What differs most is the gearing: full throttle asks for wheels at "
            f"{wheels}, full steering for an angle of {angle}."
        )
    beside = f"{names[0]} beside {names[1]}"
    return f"{beside[0].upper()}{beside[1:]}: {ratios}. {gearing}"


def in_words(rides: Mapping[str, Ride]) -> str:
    """How two robots, by their names, differ, and how far apart their rides end."""
    first, second = rides.values()
    robots = robots_in_words((first.robot, second.robot), tuple(rides))
    apart = np.linalg.norm((first.states - second.states)[-1, POSITION])
    return f"{robots} After {number(first.times[-1])} s they are {apart:.2f} m apart."


def summary(ride: Ride) -> list[str]:
    """A ride's MEASURES in words."""
    x, y, z = ride.states[:, POSITION].T
    pitch, roll = (np.ptp(angle) for angle in tilt(ride.states))
    return [
        f"{np.hypot(x[-1], y[-1]):.1f} m",
        f"{100 * np.ptp(z):.0f} cm",
        f"{pitch:.0f}° and {roll:.0f}°",
        f"{1e3 * np.ptp(ride.struts, axis=0).max():.1f} mm",
        _at_stops(ride),
    ]


def _at_stops(ride: Ride) -> str:
    """Shares of the time at a stop by strut, such as 'front left 20 %', or 'none'."""
    lower, upper = (
        np.abs(ride.struts - stop) < NEAR
        for stop in (ride.robot.travel_lower, ride.robot.travel_upper)
    )
    if ride.strut_motors:
        upper[:, HELD] = False
    shares = np.rint(100 * (lower | upper).mean(axis=0)).astype(int)
    named = zip(STRUTS, shares, strict=True)
    texts = [f"{name} {share}\N{NO-BREAK SPACE}%" for name, share in named if share]
    return ", ".join(texts) or "none"


def table_html(rides: Mapping[str, Ride]) -> str:
    """Values of the robots and measures of their rides, by name, as an HTML table."""
    robots = [ride.robot for ride in rides.values()]
    lines = [(row.label, *(value_text(row, robot) for robot in robots)) for row in ROWS]
    lines += zip(MEASURES, *map(summary, rides.values()), strict=True)
    head = "".join(f'<th scope="col">{html.escape(name)}</th>' for name in ("", *rides))
    body = "".join(
        f'<tr><th scope="row">{label}</th>'
        + "".join(f"<td>{text}</td>" for text in texts)
        + "</tr>"
        for label, *texts in lines
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
