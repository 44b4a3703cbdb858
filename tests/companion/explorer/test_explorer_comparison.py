"""Two robots and their rides in words."""

import numpy as np
import pytest

from companion.explorer.comparison import (
    MEASURES,
    ROWS,
    at_stops,
    robots_in_words,
    table_html,
    times,
    value_text,
)
from ownrobot.replay import ROBOTS, Ride

NOVICE, EXPERT = ROBOTS["system1 novice"], ROBOTS["system1 expert"]


def standing(robot, struts, strut_motors=True):
    """A ride of a robot that stands while its struts have this travel, mm."""
    moments = len(struts)
    states = np.zeros((moments, 13))
    states[:, 6] = 1
    joints = np.zeros((moments, 10))
    travel = np.array(struts) / 1000
    return Ride(
        robot,
        np.zeros((3, 3)),
        0.05 * np.arange(moments),
        states,
        travel,
        joints,
        strut_motors,
    )


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        (50_000, 10_000, "5 times the spring"),
        (50_000, 75, "667 times the spring"),
        (13, 20, "1.5 times less spring"),
        (20, 20, "the same spring"),
        (0, 50, "no spring"),
        (50, 0, "spring, which the other lacks"),
    ],
)
def test_ratios_are_the_papers_words(first, second, words):
    assert times("spring", first, second) == words


def test_a_pair_differs_in_gearing_and_a_twin_does_not():
    pair = robots_in_words((NOVICE, EXPERT), ("system 1 novice", "system 1 expert"))
    assert pair == (
        "System 1 novice beside system 1 expert: "
        "5 times the spring, 2 times the damping, the same travel. "
        "What differs most is the gearing: full throttle asks for wheels at 30 rad/s "
        "against 60 rad/s, full steering for an angle of 0.5 rad against 0.8 rad."
    )
    twins = robots_in_words((NOVICE, NOVICE.replace(spring=500.0)), ("one", "two"))
    assert twins == (
        "One beside two: 100 times the spring, the same damping, the same travel. "
        "The gearing is the same."
    )


def test_values_have_units():
    texts = {row.label: value_text(row, ROBOTS["system2 novice"]) for row in ROWS}
    assert texts["spring"] == "50,000 N/m"
    assert texts["damping"] == "100 N s/m"
    assert texts["travel"] == "13 mm (−10 to 3)"
    assert texts["friction of the tyres"] == "1"


def test_struts_at_a_stop_are_named():
    struts = [[0, -20, -19.9, -5], [0, 0, -5, 0.1], [0, 0, -5, -5], [0, 0, -5, -5]]
    free, held = (standing(NOVICE, struts, motors) for motors in (False, True))
    told = at_stops(free).replace("\N{NO-BREAK SPACE}", " ")
    assert told == (
        "rear right 100 %, rear left 100 %, front right 25 %, front left 25 %"
    )
    assert at_stops(held).startswith("rear left 25"), "at its longest extension"
    assert at_stops(standing(NOVICE, [[0, 0, -5, -5]])) == "none"


def test_the_table_has_both_robots_and_rides():
    rides = {
        "one": standing(NOVICE, [[0, 0, -5, -5]]),
        "<two>": standing(EXPERT, [[0, 0, 0, 0]]),
    }
    table = table_html(rides)
    assert "&lt;two&gt;" in table and "<two>" not in table
    assert table.count("<tr>") == 1 + len(ROWS) + len(MEASURES)
    assert "<td>50,000 N/m</td><td>10,000 N/m</td>" in table
