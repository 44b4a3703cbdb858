"""The gap of expert and novice: components by hand, a measurement, stored results."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from companion.numerics import versions
from companion.studies import gap, overlap, payoff
from sidm.storage import read_record
from sidm.systems import FREE_SYSTEMS, SYSTEMS
from tests.companion.conftest import RESULTS


def test_components_are_told_in_the_frame_of_the_start():
    """A metre along the heading is forward, whatever the heading.

    A turn goes on across 180 degrees.
    """
    yaw = 3.0
    states = np.zeros((3, 13))
    for number, turn in enumerate((0.0, 0.1, 0.3)):
        states[number, 5:7] = np.sin((yaw + turn) / 2), np.cos((yaw + turn) / 2)
    states[1:, :2] = np.array([np.cos(yaw), np.sin(yaw)])
    states[2, 2], states[:, 7] = 0.2, 0.5
    parts = gap.components(states, yaw)
    assert parts[1] == pytest.approx([1, 0, 0, 0, 0, 0.1, 0.5, *[0] * 5])
    assert parts[2, :6] == pytest.approx([1, 0, 0.2, 0, 0, 0.3])


@pytest.mark.more
def test_a_pair_is_measured_from_the_same_starts(tmp_path):
    """The robots part with time.

    The result does not depend on how many starts a worker drives.
    """
    with ThreadPoolExecutor(1) as executor:
        gap.measure(executor, tmp_path, ["system1"], starts=3)
    table = gap.table(tmp_path)
    forward = table[table.component == "forward"].set_index("time")
    assert forward.gap[2.5] > forward.gap[0.5] > 0
    assert len(table) == len(gap.COMPONENTS) * gap.STEPS
    one = gap.simulate_components("system1", [1])
    both = gap.simulate_components("system1", [0, 1])
    assert np.array_equal(one[:, 0], both[:, 1]) and not np.array_equal(one[0], one[1])
    assert not len(gap.table(tmp_path / "nothing"))
    assert gap.figure(gap.table(tmp_path / "nothing")).axes[0].texts


@pytest.mark.parametrize(
    ("study", "kind"),
    [(gap, "free_struts"), (overlap, "simulation"), (payoff, "free_struts")],
)
def test_what_is_stored_is_of_todays_physics(study, kind):
    repeated = f"again: companion run --figure {Path(study.NAME).stem}"
    assert read_record(RESULTS / study.NAME)["numerics"] == versions(kind), repeated


def test_robots_drive_sensibly():
    """Robots with free struts move vertically less than rocks are high, in the mean."""
    table = gap.table(RESULTS)
    assert set(table.system) == {*SYSTEMS, *FREE_SYSTEMS}
    up = table[table.component == "up"]
    assert (up.gap < 0.2).all() and (up.spread < 0.2).all()
    marks = [
        line
        for line in gap.figure(table).axes[0].get_lines()
        if len(line.get_xdata()) == len(gap.COMPONENTS)
    ]
    assert len(marks) == 4
