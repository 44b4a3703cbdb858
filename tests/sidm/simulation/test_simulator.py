"""The simulator: contact with the ground, resets, determinism, stability, behaviour."""

import numpy as np
import pybullet
import pytest

from sidm.simulation import Simulator
from sidm.simulation.client import Client
from sidm.systems import ROLES, SYSTEMS
from sidm.terrain import generate_terrain, height_at

FLAT = np.zeros((300, 300))
NOVICE = SYSTEMS["system1"].novice


@pytest.fixture(scope="module")
def rough():
    """A terrain of system 1."""
    return generate_terrain(SYSTEMS["system1"].terrain, 11)


def drive(simulator):
    """States of a short drive from a reset."""
    states = [simulator.reset(0.3, -0.2, 0.4)]
    return np.array(states + [simulator.step((0.7, 0.3)) for _ in range(8)])


def drive_anew(heights, visible=False):
    with Simulator(NOVICE, heights, visible=visible) as simulator:
        return drive(simulator)


def test_wheels_touch_the_ground_of_the_height_map_on_several_terrains_in_one_process():
    points = np.random.default_rng(0).uniform(-14.9, 14.9, (1500, 2))
    for name, seed in [("system2", 1), ("system1", 2)]:
        heights = generate_terrain(SYSTEMS[name].terrain, seed)
        starts, ends = (np.insert(points, 2, z, axis=1).tolist() for z in (99, -1))
        with Simulator(SYSTEMS[name].novice, heights) as simulator:
            hits = simulator._client.rayTestBatch(starts, ends)
        found = np.array([hit[3][2] for hit in hits])
        assert np.abs(found - height_at(heights, *points.T)).max() < 1e-3


def test_a_used_failed_or_visible_simulator_drives_as_a_new_one_does(rough):
    expected = drive_anew(rough)
    assert np.array_equal(drive_anew(rough, visible=True), expected)
    with Simulator(NOVICE, FLAT) as simulator:
        drive(simulator)
        simulator.set_terrain(2 * rough)
        drive(simulator)
        simulator.set_terrain(rough)
        assert np.array_equal(drive(simulator), expected)
        assert np.array_equal(drive(simulator), expected)
        for mend in (lambda: None, lambda: simulator.set_terrain(rough)):
            simulator._client.resetBaseVelocity(
                simulator._body, [np.nan] * 3, [np.nan] * 3
            )
            token = simulator.save()
            assert not np.isfinite(simulator.step((0.0, 0.0))).all()
            with pytest.raises(RuntimeError, match="not finite; call reset"):
                simulator.restore(token)
            mend()
            assert np.array_equal(drive(simulator), expected)


def test_save_and_restore_branch_exactly(rough):
    with Simulator(SYSTEMS["system1"].expert, rough) as simulator:
        simulator.reset()
        simulator.step((0.8, 0.1))
        token = simulator.save()
        first = [simulator.step((0.5, -0.5)) for _ in range(6)]
        simulator.restore(token)
        assert np.array_equal(first, [simulator.step((0.5, -0.5)) for _ in range(6)])
        simulator.forget(token)
        with pytest.raises(Exception, match="restore"):
            simulator.restore(token)


@pytest.mark.parametrize("role", ROLES)
@pytest.mark.parametrize("name", SYSTEMS)
def test_motion_stays_bounded_and_struts_within_their_stops(name, role):
    system, rng = SYSTEMS[name], np.random.default_rng(3)
    robot, ground = system.robot(role), generate_terrain(system.terrain, 7)
    with Simulator(robot, ground, system.physics) as simulator:
        simulator.reset(0, 0, 1.0)
        for _ in range(25):
            state = simulator.step(rng.uniform(-1, 1, 2))
            assert np.isfinite(state).all() and np.linalg.norm(state[7:10]) < 15
            assert np.linalg.norm(state[3:7]) == pytest.approx(1)
            struts = simulator.strut_positions
            assert (struts > robot.travel_lower - 0.004).all()
            assert (struts < robot.travel_upper + 0.004).all()


def test_on_flat_ground_it_rests_drives_and_turns_as_told():
    with Simulator(NOVICE, FLAT) as simulator:
        start = simulator.reset()
        # radius of the tyre, contact margin, height of the body above the axle
        assert start[2] == pytest.approx(0.185, abs=0.003)
        assert np.abs(start[7:]).max() < 0.02
        for _ in range(12):
            state = simulator.step((0.25, 0.0))
        # wheel speed times radius
        assert state[7] == pytest.approx(0.25 * 30 * 0.1, rel=0.03)
        simulator.reset()
        for _ in range(12):
            state = simulator.step((0.25, 1.0))
        assert state[12] < -0.3  # positive steering turns right
        simulator.reset()
        clipped = simulator.step((3.0, -7.0))
        simulator.reset()
        assert np.array_equal(clipped, simulator.step((1.0, -1.0)))


def test_wrong_input_is_refused_with_both_shapes():
    with pytest.raises(ValueError, match=r"\(H, W\).*\(300,\)"):
        Simulator(NOVICE, np.zeros(300))
    with pytest.raises(ValueError, match="finite, within 100 m"):
        Simulator(NOVICE, np.full((300, 300), np.nan))
    with Simulator(NOVICE, FLAT) as simulator:
        with pytest.raises(ValueError, match=r"\(300, 300\).*\(20, 20\)"):
            simulator.set_terrain(np.zeros((20, 20)))
        with pytest.raises(ValueError, match=r"\(2,\).*\(3,\)"):
            simulator.step((0.0, 0.0, 0.0))


def test_a_simulator_that_nobody_holds_is_freed():
    client = Client()
    number = client._number
    del client
    with Simulator(NOVICE, FLAT) as simulator:
        assert simulator._client._number == number  # its number was free again
        simulator.close()
        with pytest.raises(pybullet.error):
            simulator.reset()


def test_a_picture_follows_the_drive_and_shows_its_struts(rough):
    with Simulator(NOVICE, rough, visible=True) as simulator:
        simulator.reset()
        first = simulator.picture(64, 48)
        simulator.step((0.5, 0.0))
        assert not np.array_equal(simulator.picture(64, 48), first)
        struts = simulator.picture(320, 240, distance=1.0)
    assert first.shape == (48, 64, 3)
    assert ((struts[..., 2] > 100) & (struts[..., 0] < 40)).sum() > 100  # blue
