"""Geometry of the linkage and the model that Bullet reads.

They are compared with closed forms, closed loops and stated figures.
"""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sidm.simulation import Simulator
from sidm.simulation import dimensions as figures
from sidm.simulation.dimensions import AXLES, REAR_LEFT_RODS
from sidm.simulation.linkage import axle_joints, axle_pose, rods, twists
from sidm.simulation.robot import urdf
from sidm.simulation.suspension import Suspension
from sidm.systems import SYSTEMS, Physics

ROBOTS = SYSTEMS["system1"]


def tyres(axle):
    """Centres (2, 3) of an axle's tyres with both struts at zero."""
    left = figures.REAR_LEFT_TYRE
    return np.stack([figures.mirror(axle, side) * left for side in figures.SIDES])


def by_joints(joints, travel, points):
    """Points (n, 3) of the axle by the two joints in series.

    `travel` is that of the struts (right, left), m.
    """
    right, left = travel
    middle, points = (left + right) / 2, joints.pose.place(points)
    roll = joints.roll_rate(middle) * (left - right) / 2
    for axis, point, angle in [
        (joints.roll_axis, joints.roll_point, roll),
        (joints.heave_axis, joints.heave_point, joints.heave_angle(middle)),
    ]:
        points = Rotation.from_rotvec(angle * axis).apply(points - point) + point
    return points


def test_a_pose_keeps_the_links_and_shortens_the_struts():
    for axle, travel in [("rear", (-0.02, -0.003)), ("front", (0.0, -0.015))]:
        ends, pose = rods(axle), axle_pose(axle, travel)
        length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
        moved = np.linalg.norm(pose.place(ends[:, 0]) - ends[:, 1], axis=1)
        assert length - moved == pytest.approx([0, 0, 0, 0, *travel], abs=1e-10)


def test_travel_that_no_link_allows_is_refused(monkeypatch):
    with pytest.raises(ValueError, match="rear axle cannot reach .* 0.5 and 0.5 m"):
        axle_pose("rear", (0.5, 0.5))
    with pytest.raises(ValueError, match="-0.06 to 0.02 m, not -0.1 to 0.0"):
        axle_joints("front", -0.1, 0.0)
    # with all rods in one plane nothing holds sideways: the equations are singular
    flat = REAR_LEFT_RODS * (1, 0, 1)
    monkeypatch.setattr("sidm.simulation.linkage.REAR_LEFT_RODS", flat)
    with pytest.raises(ValueError, match="front axle cannot reach"):
        axle_pose("front", (-0.01, 0.0))


@pytest.mark.parametrize("axle", AXLES)
def test_twists_are_the_derivatives_of_the_pose(axle):
    points, travel, small = rods(axle)[:, 0], np.array([-0.004, -0.009]), 1e-6
    pose = axle_pose(axle, travel)
    for twist, step in zip(twists(axle, pose), small * np.eye(2), strict=True):
        ahead, behind = (axle_pose(axle, travel + one) for one in (step, -step))
        moved = (ahead.place(points) - behind.place(points)) / (2 * small)
        turned = np.cross(twist[:3], pose.place(points)) + twist[3:]
        assert moved == pytest.approx(turned, abs=1e-5)


def test_roll_turns_about_the_line_between_the_meeting_points_of_each_pair_of_links():
    joints = axle_joints("rear", 0.0, 0.0)
    for axle_end, body_end in REAR_LEFT_RODS[:2]:
        along = axle_end - body_end
        meets = axle_end - along * axle_end[1] / along[1]  # where y is 0
        off = np.cross(meets - joints.roll_point, joints.roll_axis)
        assert np.linalg.norm(off) < 1e-9


def test_lines_and_rates_are_the_stated_ones():
    # stated figures of the robot: heave about (0.2158, 0, 0.0635) with 0.2032 m/rad,
    # roll along (0.9746, 0, 0.2238) with 0.0273 m/rad
    joints = axle_joints("rear", 0.0, 0.0)
    assert joints.heave_point == pytest.approx((0.2158, 0, 0.0635), abs=1e-4)
    assert joints.heave_axis == pytest.approx((0, 1, 0), abs=1e-9)
    assert joints.roll_axis == pytest.approx((0.9746, 0, 0.2238), abs=1e-4)
    assert joints.heave_travel[1] == pytest.approx(0.2032, rel=2e-3)
    assert 1 / joints.roll_rate(0.0) == pytest.approx(0.0273, rel=2e-3)


@pytest.mark.parametrize("limits", [(-0.02, 0.0), (-0.01, 0.003)])
@pytest.mark.parametrize("axle", AXLES)
def test_wheels_stay_within_3_millimetres_of_the_closed_linkage(axle, limits):
    """The bound holds over the whole travel."""
    joints, wheels = axle_joints(axle, *limits), tyres(axle)
    for right in np.linspace(*limits, 5):
        for left in np.linspace(*limits, 5):
            exact = axle_pose(axle, (right, left)).place(wheels)
            off = by_joints(joints, (right, left), wheels) - exact
            assert np.linalg.norm(off, axis=1).max() < 0.003


@pytest.mark.parametrize(
    ("robot", "total"), [(ROBOTS.novice, 13.0), (ROBOTS.expert, 1.20456 + 1.5 * 11.79)]
)
def test_masses_add_up_and_lines_are_short_enough_for_bullets_reader(robot, total):
    model = urdf(robot, {axle: Suspension(robot, axle, Physics()) for axle in AXLES})
    masses = ElementTree.fromstring(model).iter("mass")
    mass = sum(float(mass.get("value")) for mass in masses)
    assert mass == pytest.approx(total, rel=0.01)
    assert max(map(len, model.splitlines())) < 1000


@pytest.mark.parametrize("motors", [True, False])
def test_with_struts_at_zero_the_tyres_are_where_the_figures_have_them(motors):
    physics = Physics(strut_motors=motors)
    with Simulator(ROBOTS.expert, np.zeros((300, 300)), physics) as simulator:
        links = simulator._client.getLinkStates(
            simulator._body, simulator._wheels, computeForwardKinematics=1
        )
        assert simulator.strut_positions == pytest.approx(np.zeros(4), abs=1e-6)
    expected = np.concatenate([tyres(axle) for axle in AXLES])
    places = np.array([link[4] for link in links])
    assert places == pytest.approx(expected, abs=1e-3)  # exact at mid-travel
