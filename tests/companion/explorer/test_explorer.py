"""The suspension explorer."""

import base64
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from companion.explorer import grid, page
from companion.explorer.live import (
    SIZE,
    both_rides,
    explorer,
    helper_process,
    softer,
    with_picture,
)
from companion.explorer.views import rides_figure
from companion.numerics import versions
from ownrobot.replay import ROBOTS, Ride, find_robot, ride, tilt, weave
from ownrobot.replay.packing import unpack
from sidm.config import ConfigError
from sidm.simulation import Simulator
from sidm.systems import Terrain

ROOT = Path(__file__).parents[3]
GROUND = Terrain(cell_height_scale=0.35)
GEARS = ("throttle_scale", "steering_scale")


def test_a_ride_has_its_steps_and_repeats(rides):
    first_ride = rides["system1 novice"]
    assert first_ride.states.shape == (11, 13)
    assert first_ride.struts.shape == (11, 4)
    assert first_ride.joints.shape == (11, 10)
    assert first_ride.times == pytest.approx(0.05 * np.arange(11))
    repeated = ride(ROBOTS["system1 novice"], GROUND, 3, 0.5, steps=5)
    assert all(
        np.array_equal(getattr(first_ride, name), getattr(repeated, name))
        for name in ("states", "struts", "joints")
    )


def test_looking_twice_a_step_changes_nothing(rides):
    """Motion sampled at 20 Hz equals motion sampled at 10 Hz, bit for bit."""
    first_ride = rides["system1 novice"]
    with Simulator(first_ride.robot, first_ride.heights) as simulator:
        states = [
            simulator.reset(),
            *(simulator.step(np.array([0.5, 0.0])) for _ in range(5)),
        ]
    assert np.array_equal(first_ride.states[::2], states)


def test_weaving_turns_the_kingpins_to_both_sides():
    simulated = ride(ROBOTS["system1 novice"], GROUND, 3, 0.5, weave(16), steps=16)
    kingpins = simulated.joints[:, 8:]
    assert kingpins.max() == pytest.approx(0.3, abs=0.02)
    assert kingpins.min() == pytest.approx(-0.3, abs=0.02)
    assert simulated.joints[-1, 4:8].min() > 5  # the wheels have turned


def test_the_rear_struts_move_only_when_they_are_free():
    robot = ROBOTS["system2 expert"]
    held, free = (
        ride(robot, GROUND, 3, 0.8, steps=12, strut_motors=motors)
        for motors in (True, False)
    )
    assert np.ptp(held.struts[:, :2]) < 0.002 < np.ptp(free.struts[:, :2])


@pytest.mark.parametrize(("pitch", "roll"), [(10.0, 0.0), (0.0, -25.0), (30.0, 40.0)])
def test_tilt_is_that_of_the_euler_angles(pitch, roll):
    state = np.zeros(13)
    state[3:7] = Rotation.from_euler("ZYX", [70.0, pitch, roll], degrees=True).as_quat()
    assert tilt(state) == pytest.approx((pitch, roll))


def test_the_figure_draws_what_was_ridden(rides):
    figure = rides_figure(rides)
    height, _, travel, rear, path = figure.axes
    assert np.allclose(
        height.lines[0].get_ydata(), rides["system1 novice"].states[:, 2]
    )
    assert np.allclose(
        travel.lines[0].get_ydata(), 1e3 * rides["system1 novice"].struts[:, 2]
    )
    assert np.allclose(
        rear.lines[1].get_ydata(), 1e3 * rides["system1 novice"].struts[:, 1]
    )
    names = [text.get_text() for text in figure.legends[0].get_texts()][:2]
    assert names == ["system 1 novice", "system 2 expert"]
    assert len(path.lines) == 2


def test_two_rides_at_once_are_those_one_after_the_other():
    """The helper process makes the same ride as this process."""
    robots = (ROBOTS["system1 novice"], ROBOTS["system2 expert"])
    same = (0.35, 0, 0.5, 3, True)
    helper_process()[1].result()
    for one, robot in zip(both_rides(*robots, *same), robots, strict=True):
        alone = ride(robot, Terrain(cell_height_scale=0.35, size=SIZE), steps=3)
        assert one.robot == robot and np.array_equal(one.states, alone.states)


@pytest.fixture
def live():
    """The explorer's parts by what a reader calls them, and its box."""
    box = explorer(steps=3)
    controls, words, screen, film = box.children
    presets, *others = controls.children
    parts = {part.description: part for part in (*presets.children, *others)}
    return parts, words, screen, film, box


def test_sliders_and_choices_draw_anew_and_a_button_shows_them_driving(live):
    parts, words, screen, film, box = live
    first = screen.value
    assert with_picture(box)["image/png"] in first
    assert base64.b64decode(with_picture(box)["image/png"])[:4] == b"\x89PNG"
    assert 'alt="Height of the body' in first
    assert film.value == ""
    parts["see them drive"].value = True
    shown = film.value
    assert "<iframe" in shown and "its twin with 10,000 N/m" in shown
    assert "scrollIntoView" in shown
    parts["spring (N/m)"].value = 100.0
    assert screen.value != first and "<iframe" in film.value and film.value != shown
    assert "scrollIntoView" not in film.value, "the page stays where it is"
    assert "your robot" in words.value
    second = screen.value
    parts["your robot starts as"].value = "system2 expert"
    assert parts["spring (N/m)"].value == pytest.approx(75.0)
    assert screen.value != second and "system 2 expert" in words.value


def test_it_opens_with_a_robot_and_its_softer_twin(live):
    _, words, *_ = live
    assert (
        "System 1 novice beside its twin with 10,000 N/m: 5 times the spring, the same "
        "damping, the same travel. The gearing is the same." in words.value
    )


def test_buttons_choose_the_pairs_and_only_their_springs(live):
    parts, words, *_ = live
    parts["system 2's pair"].click()
    assert "667 times the spring, 100 times the damping, 1.5 times less travel" in (
        words.value
    )
    assert "What differs most is the gearing" in words.value
    parts["only the springs"].click()
    assert "667 times the spring, the same damping, the same travel" in words.value
    assert parts["deepest compression (mm)"].value == 3
    parts["system 1's pair"].click()
    assert "5 times the spring, 2 times the damping, the same travel" in words.value


def test_a_ghost_leaves_the_sliders_alone_until_its_springs_are_taken(live):
    parts, words, *_ = live
    parts["compared with"].value = "system2 novice"
    assert parts["longest extension (mm)"].value == -20
    parts["take its springs, dampers and travel"].click()
    assert parts["longest extension (mm)"].value == -10
    assert parts["deepest compression (mm)"].value == 3
    assert "the same spring, the same damping, the same travel" in words.value


def test_the_softest_robot_opens_beside_a_stiffer_one():
    assert softer(ROBOTS["system1 novice"]) == 10_000
    assert softer(ROBOTS["system2 expert"]) == 50_000


def test_an_unknown_robot_is_named_with_the_nearest():
    with pytest.raises(ConfigError, match="system1 novise.*system1 novice"):
        find_robot("system1 novise")


@pytest.fixture(scope="module")
def stored():
    return grid.read(ROOT / grid.FOLDER)


def test_the_stored_rides_are_of_todays_physics(stored):
    assert stored.numerics == versions("free_struts"), (
        "make them anew: companion run --figure explorer"
    )


@pytest.mark.more
def test_a_stored_ride_is_what_is_simulated(stored):
    """The first second agrees; later, different rounding may have grown."""
    at = (1, 2, 1, 1)
    robot = grid.BODY.replace(
        **{knob.name: knob.values[i] for knob, i in zip(grid.SET_UP, at, strict=True)}
    )
    roughness, throttle = (list(knob.values) for knob in grid.DRIVE)
    drives = [throttle.index(0.5), len(throttle)]  # straight ahead, and weaving
    repeated = grid.simulate((robot, True), drives)
    kept = stored.rides[at][0][:, drives]
    assert repeated.shape == (len(roughness), 2, grid.SAMPLES, len(grid.CHANNELS))
    assert np.abs(repeated[:, :, :21].astype(int) - kept[:, :, :21]).max() <= 20
    # on level ground, only the weaving ride steers
    assert kept[0, 0, :, -1].any() != kept[0, 1, :, -1].any()


def test_stored_numbers_end_where_the_ground_does():
    """Channels have whole numbers, and none after a robot has left the ground."""
    states = np.zeros((5, 13))
    states[:, 6] = -1  # upright: -q is the same attitude as q
    states[:, 0] = [0.0, 1.2344, 14.6, 3.0, 2.0]
    joints = np.zeros((5, 10))
    joints[:, [1, 3, 4, 8]] = [0.01, 0.02, 1.0, 0.3]
    one = Ride(
        grid.BODY,
        np.zeros((300, 300)),
        0.05 * np.arange(5),
        states,
        np.full((5, 4), -0.01234),
        joints,
    )
    numbers = grid.whole_numbers(one)
    rest = [0, 0, 0, 0, 0, *[-123] * 4, 3, 6, 20, 0, 0, 0, 30]
    assert numbers[:2].tolist() == [[0, *rest], [617, *rest]]
    assert (numbers[2:] == grid.GONE).all()


def test_the_page_has_what_was_stored(stored):
    pieces = dict(page.pieces(stored, ROOT / grid.FOLDER))
    one = unpack(base64.b64decode(pieces["rides-3"]), stored.rides.shape[5:])
    assert np.array_equal(one, stored.rides[0, 0, 0, 1, 1])
    assert np.array_equal(
        unpack(base64.b64decode(pieces["rides-127"]), one.shape), stored.robots[3, 1]
    )


def test_sliders_reach_the_suspension_of_every_robot_of_the_paper():
    for robot in grid.PAPER_ROBOTS.values():
        assert all(getattr(robot, knob.name) in knob.values for knob in grid.SET_UP)


@pytest.mark.more
def test_a_system_that_is_added_rides_anew_and_is_not_among_the_stored():
    code = """
import dataclasses
from sidm.systems import SYSTEMS
old = SYSTEMS["system1"]
novice = old.novice.replace(spring=500.0)
SYSTEMS["soft"] = dataclasses.replace(old, name="soft", novice=novice)
from companion.explorer import grid, page
from ownrobot.replay import find_robot
assert find_robot("soft novice").spring == 500
robots = [robot["name"] for robot in page.contents()["robots"]]
assert len(robots) == len(grid.PAPER_ROBOTS) == 4 and "soft novice" not in robots
"""
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True
    )
    assert result.returncode == 0, result.stderr


def test_the_page_keeps_within_its_size(stored, tmp_path):
    page.write(tmp_path, stored)
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) < 5e6


def test_the_page_says_what_the_rides_show(stored):
    """The page's figures under 'What to look for' follow from the braked set-ups.

    Soft springs let a strut use nearly all of its travel.
    """
    rough, half = 1, 1
    assert [
        knob.values[at] for knob, at in zip(grid.DRIVE, (rough, half), strict=True)
    ] == [0.35, 0.5]
    rides = np.where(stored.rides == grid.GONE, np.nan, stored.rides.astype(float))
    rides = rides[:, :, :, :, 0]
    struts = [list(grid.CHANNELS).index(f"strut {number}") for number in (2, 3)]
    # spring, damping, stops, time, strut
    front = rides[:, :, :, :, rough, half][..., struts] / 1e4
    ways = np.nanmax(front, axis=-2) - np.nanmin(front, axis=-2)
    lower, upper = (np.array(knob.values) for knob in grid.STOPS)
    used = ways[0] / (upper - lower[:, None])[..., None]
    assert used.min() > 0.8 and np.median(used) > 0.99
    assert ways[-1].max() < 0.006
    ends = rides[..., 0, half, -1, :2].reshape(-1, 2) / 500
    assert np.ptp(ends, axis=0).max() < 0.1


@pytest.mark.parametrize("names", grid.PAIRS.values(), ids=grid.PAIRS)
def test_gearing_is_what_moves_a_pair_apart_most(names):
    """The explorers say so: all other values of the expert together do less."""
    novice, expert = (ROBOTS[name] for name in names)
    geared, other = (
        one.replace(**{field: getattr(gears, field) for field in GEARS})
        for one, gears in ((novice, expert), (expert, novice))
    )
    start, by_gearing, by_others = (
        ride(one, GROUND, 3, 0.5, weave(25), steps=25).states[-1, :2]
        for one in (novice, geared, other)
    )
    apart = np.linalg.norm(by_gearing - start)
    assert apart > 2 * np.linalg.norm(by_others - start)
