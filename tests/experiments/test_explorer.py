"""The suspension explorer."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sidm.config import ConfigError
from sidm.experiments.explorer import ROBOTS, explorer, find_robot, ride, rides_figure, tilt
from sidm.systems import Terrain

GROUND = Terrain(cell_height_scale=0.35)


@pytest.fixture(scope="module")
def rides():
    """Two robots over the same ground for half a second."""
    return {name: ride(ROBOTS[name], GROUND, 3, 0.5, steps=5) for name in ("system1 novice", "system2 expert")}


def test_a_ride_has_its_steps_and_repeats(rides):
    one = rides["system1 novice"]
    assert one.states.shape == (6, 13) and one.struts.shape == (6, 4)
    again = ride(ROBOTS["system1 novice"], GROUND, 3, 0.5, steps=5)
    assert np.array_equal(one.states, again.states) and np.array_equal(one.struts, again.struts)


def test_the_rear_struts_move_only_when_they_are_free():
    robot = ROBOTS["system2 expert"]
    held, free = (ride(robot, GROUND, 3, 0.8, steps=12, strut_motors=motors) for motors in (True, False))
    assert np.ptp(held.struts[:, :2]) < 0.002 < np.ptp(free.struts[:, :2])


@pytest.mark.parametrize(("pitch", "roll"), [(10.0, 0.0), (0.0, -25.0), (30.0, 40.0)])
def test_tilt_is_that_of_the_euler_angles(pitch, roll):
    state = np.zeros(13)
    state[3:7] = Rotation.from_euler("ZYX", [70.0, pitch, roll], degrees=True).as_quat()
    assert tilt(state) == pytest.approx((pitch, roll))


def test_the_figure_draws_what_was_ridden(rides):
    height, _, travel, path = rides_figure(rides).axes
    assert np.allclose(height.lines[0].get_ydata(), rides["system1 novice"].states[:, 2])
    assert np.allclose(travel.lines[0].get_ydata(), 1e3 * rides["system1 novice"].struts[:, 2])
    assert [line.get_label() for line in path.lines] == list(rides)


def test_a_slider_draws_anew():
    box = explorer(steps=3)
    *knobs, screen = box.children
    before = screen.value
    next(knob for knob in knobs if knob.description.startswith("spring")).value = 100.0
    assert before[:4] == screen.value[:4] == b"\x89PNG" and before != screen.value


def test_a_mistyped_robot_is_named_with_the_nearest():
    with pytest.raises(ConfigError, match="system1 novise.*system1 novice"):
        find_robot("system1 novise")
