"""The suspension explorer: rides, the live page, and the page of stored rides."""

import base64
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from companion.explorer import grid, page
from companion.explorer.comparison import table_html, times
from companion.explorer.live import (
    SIZE,
    both_rides,
    explorer,
    helper_process,
    softer,
    with_picture,
)
from ownrobot.replay import ROBOTS, Ride, find_robot, ride, tilt, weave
from ownrobot.replay.viewer import unpack
from sidm.config import ConfigError
from sidm.simulation import Simulator
from sidm.systems import Terrain

ROOT = Path(__file__).parents[3]
GROUND = Terrain(cell_height_scale=0.35)
GEARS = ("throttle_scale", "steering_scale")


def test_looking_twice_a_step_changes_nothing(rides):
    """Motion sampled at 20 Hz equals motion sampled at 10 Hz, bit for bit."""
    first_ride = rides["system1 novice"]
    with Simulator(first_ride.robot, first_ride.heights) as simulator:
        states = [simulator.reset()]
        states += [simulator.step(np.array([0.5, 0.0])) for _ in range(5)]
    assert np.array_equal(first_ride.states[::2], states)


def test_tilt_is_that_of_the_euler_angles():
    """A robot that turns over has no jump in its roll."""
    rolls = np.array([40.0, 120.0, 175.0, 200.0, 320.0])
    angles = np.column_stack([np.full(5, 70.0), np.full(5, 30.0), rolls])
    states = np.zeros((5, 13))
    states[:, 3:7] = Rotation.from_euler("ZYX", angles, degrees=True).as_quat()
    pitch, roll = tilt(states)
    assert pitch == pytest.approx(np.full(5, 30.0)) and roll == pytest.approx(rolls)


def test_two_rides_at_once_are_those_one_after_the_other():
    robots = (ROBOTS["system1 novice"], ROBOTS["system2 expert"])
    helper_process()[1].result()
    both = both_rides(*robots, 0.35, 0, 0.5, 3, True)
    for one, robot in zip(both, robots, strict=True):
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


def test_sliders_draw_anew_and_a_button_shows_them_driving(live):
    parts, words, screen, film, box = live
    first = screen.value
    picture = with_picture(box)["image/png"]
    assert picture in first and base64.b64decode(picture)[:4] == b"\x89PNG"
    assert 'alt="Height of the body' in first and film.value == ""
    parts["see them drive"].value = True
    shown = film.value
    assert "its twin with 10,000 N/m" in shown and "scrollIntoView" in shown
    parts["spring (N/m)"].value = 100.0
    assert screen.value != first and "<iframe" in film.value != shown
    assert "scrollIntoView" not in film.value, "the page stays where it is"
    parts["your robot starts as"].value = "system2 expert"
    assert parts["spring (N/m)"].value == pytest.approx(75.0)
    assert "system 2 expert" in words.value


def test_buttons_choose_pairs_and_words_compare_them(live):
    parts, words, *_ = live
    assert (
        "System 1 novice beside its twin with 10,000 N/m: 5 times the spring, the same "
        "damping, the same travel. The gearing is the same." in words.value
    )
    parts["compared with"].value = "system2 novice"
    parts["take its springs, dampers and travel"].click()
    assert parts["longest extension (mm)"].value == -10
    assert "the same spring, the same damping, the same travel" in words.value
    parts["system 2's pair"].click()
    assert "667 times the spring, 100 times the damping, 1.5 times less travel" in (
        words.value
    )
    assert "What differs most is the gearing" in words.value
    parts["only the springs"].click()
    assert "667 times the spring, the same damping, the same travel" in words.value
    parts["your robot starts as"].value = "system2 novice"
    parts["compared with"].value = "system2 novice"
    assert "the same robot: the same spring" in words.value


def test_ratios_are_the_papers_words():
    assert times("spring", 13, 20) == "1.5 times less spring"
    assert times("spring", 0, 50) == "no spring"
    assert times("spring", 50, 0) == "spring, which the other lacks"


def test_the_table_escapes_names_and_has_units(rides):
    named = {"one": rides["system1 novice"], "<two>": rides["system2 expert"]}
    table = table_html(named)
    assert "&lt;two&gt;" in table and "<two>" not in table
    assert "<td>50,000 N/m</td><td>75 N/m</td>" in table


def test_robots_are_found_by_name():
    assert softer(ROBOTS["system1 novice"]) == 10_000
    assert softer(ROBOTS["system2 expert"]) == 50_000, "the softest beside a stiffer"
    with pytest.raises(ConfigError, match="system1 novise.*system1 novice"):
        find_robot("system1 novise")


def stored_rides() -> tuple[np.ndarray, np.ndarray]:
    """The stored rides of the sliders' robots, an axis a slider, and of the paper's."""
    grounds, throttles = (len(knob.values) for knob in grid.DRIVE)
    shape = grounds, throttles + 1, grid.SAMPLES, len(grid.CHANNELS)
    parts = [unpack(part, shape) for part in grid.read(ROOT / grid.FOLDER)]
    both = np.array(parts).reshape(-1, len(grid.BRAKES), *shape)
    set_ups, robots = np.split(both, [-len(grid.PAPER_ROBOTS)])
    axes = (len(knob.values) for knob in grid.SET_UP)
    return set_ups.reshape(*axes, *both.shape[1:]), robots


@pytest.fixture(scope="module")
def stored():
    return stored_rides()


@pytest.mark.more
def test_a_stored_ride_is_what_is_simulated(stored):
    """Half a second agrees, and most of a second; then different rounding has grown."""
    at = (1, 2, 1, 1)
    robot = grid.BODY.replace(
        **{knob.name: knob.values[i] for knob, i in zip(grid.SET_UP, at, strict=True)}
    )
    repeated, kept = grid.simulate((robot, True)), stored[0][at][0]
    assert repeated.shape == kept.shape
    apart = np.abs(repeated.astype(int) - kept)
    assert apart[:, :, :11].max() <= 10 and np.quantile(apart[:, :, :21], 0.99) <= 12
    # on level ground, only the weaving ride steers
    assert kept[0, ..., -1].any(-1).tolist() == [False, False, False, True]


def test_stored_numbers_end_where_the_ground_does():
    states, joints = np.zeros((5, 13)), np.zeros((5, 10))
    states[:, 6] = -1  # upright: -q is the same attitude as q
    states[:, 0] = [0.0, 1.2344, 14.6, 3.0, 2.0]
    joints[:, [1, 3, 4, 8]] = [0.01, 0.02, 1.0, 0.3]
    time, struts = 0.05 * np.arange(5), np.full((5, 4), -0.01234)
    one = Ride(grid.BODY, np.zeros((300, 300)), time, states, struts, joints)
    numbers = grid.whole_numbers(one)
    rest = [0, 0, 0, 0, 0, *[-123] * 4, 3, 6, 20, 0, 0, 0, 30]
    assert numbers[:2].tolist() == [[0, *rest], [617, *rest]]
    assert (numbers[2:] == grid.GONE).all()


def test_the_page_has_what_was_stored_and_keeps_within_its_size(stored, tmp_path):
    packed = grid.read(ROOT / grid.FOLDER)
    pieces = dict(page.pieces(packed, ROOT / grid.FOLDER))
    for name, rides in (("3", stored[0][0, 0, 0, 1, 1]), ("127", stored[1][3, 1])):
        piece = base64.b64decode(pieces[f"rides-{name}"])
        assert np.array_equal(unpack(piece, rides.shape), rides)
    page.write(tmp_path, packed)
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) < 5e6


def test_the_page_says_what_the_rides_show(stored):
    """The page's figures below the sliders follow from the rides with held struts.

    Soft springs let a strut use nearly all of its travel.
    """
    rough, half = (knob.values.index(knob.start) for knob in grid.DRIVE)
    rides = stored[0][:, :, :, :, 0]
    rides = np.where(rides == grid.GONE, np.nan, rides.astype(float))
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
