"""Geometry of the linkage against closed form, closed loops and stated figures."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sidm.simulation.dimensions import (
    AXLES,
    REAR_LEFT_RODS,
    REAR_LEFT_TYRE,
    SIDES,
    mirror,
)
from sidm.simulation.linkage import Pose, axle_joints, axle_pose, rods, twists

REST = Pose(np.eye(3), np.zeros(3))
TRAVELS = {
    "system 1 and system 2's expert": (-0.02, 0.0),
    "system 2's novice": (-0.01, 0.003),
}


def by_joints(joints, travel, points):
    """Points (n, 3) of the axle by the two joints in series.

    `travels` are those of the struts (right, left), m.
    """
    right, left = travel
    points = joints.pose.place(points)
    for axis, point, angle in [
        (
            joints.roll_axis,
            joints.roll_point,
            joints.roll_rate((left + right) / 2) * (left - right) / 2,
        ),
        (joints.heave_axis, joints.heave_point, joints.heave_angle((left + right) / 2)),
    ]:
        points = Rotation.from_rotvec(angle * axis).apply(points - point) + point
    return points


def meeting(first, second):
    """Point where two lines (2, 2) cross, each given by two points in a plane."""
    (a, b), (c, d) = first, second
    along = np.linalg.solve(np.stack([b - a, c - d], axis=1), c - a)
    return a + along[0] * (b - a)


def test_a_pose_keeps_the_links_and_shortens_the_struts():
    for axle, travel in [("rear", (-0.02, -0.003)), ("front", (0.0, -0.015))]:
        ends = rods(axle)
        length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
        moved = np.linalg.norm(
            axle_pose(axle, travel).place(ends[:, 0]) - ends[:, 1], axis=1
        )
        assert length - moved == pytest.approx([0, 0, 0, 0, *travel], abs=1e-10)


def test_travel_that_no_link_allows_is_refused():
    with pytest.raises(
        ValueError, match="rear axle cannot reach strut travels of 0.5 and 0.5 m"
    ):
        axle_pose("rear", (0.5, 0.5))
    with pytest.raises(ValueError, match="-0.06 to 0.02 m, not -0.1 to 0.0"):
        axle_joints("front", -0.1, 0.0)


def test_links_that_hold_nothing_sideways_are_refused(monkeypatch):
    """With all rods in one plane the equations are singular in any arithmetic.

    One of their columns is exactly 0.
    """
    monkeypatch.setattr(
        "sidm.simulation.linkage.REAR_LEFT_RODS", REAR_LEFT_RODS * (1, 0, 1)
    )
    with pytest.raises(
        ValueError, match="front axle cannot reach strut travels of -0.01 and 0.0 m"
    ):
        axle_pose("front", (-0.01, 0.0))


@pytest.mark.parametrize("axle", AXLES)
def test_twists_are_the_derivatives_of_the_pose(axle):
    points, travel, small = rods(axle)[:, 0], np.array([-0.004, -0.009]), 1e-6
    pose = axle_pose(axle, travel)
    for i, twist in enumerate(twists(axle, pose)):
        step = small * np.eye(2)[i]
        moved = axle_pose(axle, travel + step).place(points) - axle_pose(
            axle, travel - step
        ).place(points)
        here = pose.place(points)
        assert moved / (2 * small) == pytest.approx(
            np.cross(twist[:3], here) + twist[3:], abs=1e-5
        )


def test_heave_turns_about_the_point_where_the_links_lines_meet_seen_from_the_side():
    lower, upper = REAR_LEFT_RODS[0][:, ::2], REAR_LEFT_RODS[1][:, ::2]
    joints = axle_joints("rear", 0.0, 0.0)
    assert joints.heave_point[::2] == pytest.approx(meeting(lower, upper), abs=1e-9)
    assert joints.heave_axis == pytest.approx((0, 1, 0), abs=1e-9)


def test_roll_turns_about_the_line_between_the_meeting_points_of_each_pair_of_links():
    joints = axle_joints("rear", 0.0, 0.0)
    for rod in REAR_LEFT_RODS[:2]:
        axle_end, body_end = rod
        # where y is 0
        meets = axle_end + (axle_end - body_end) * axle_end[1] / (
            body_end[1] - axle_end[1]
        )
        assert (
            np.linalg.norm(np.cross(meets - joints.roll_point, joints.roll_axis)) < 1e-9
        )


def test_lines_and_rates_are_the_stated_ones():
    # stated figures of the robot: heave about (0.2158, 0, 0.0635) with 0.2032 m/rad,
    # roll along (0.9746, 0, 0.2238) with 0.0273 m/rad
    joints = axle_joints("rear", 0.0, 0.0)
    assert joints.heave_point == pytest.approx((0.2158, 0, 0.0635), abs=1e-4)
    assert joints.roll_axis == pytest.approx((0.9746, 0, 0.2238), abs=1e-4)
    assert joints.heave_travel[1] == pytest.approx(0.2032, rel=2e-3)
    assert 1 / joints.roll_rate(0.0) == pytest.approx(0.0273, rel=2e-3)


@pytest.mark.parametrize("limits", TRAVELS.values(), ids=TRAVELS)
@pytest.mark.parametrize("axle", AXLES)
def test_wheels_stay_within_3_millimetres_of_the_closed_linkage(axle, limits):
    """The bound holds over the whole travel."""
    joints = axle_joints(axle, *limits)
    wheels = np.stack([mirror(axle, side) * REAR_LEFT_TYRE for side in SIDES])
    for right in np.linspace(*limits, 5):
        for left in np.linspace(*limits, 5):
            exact = axle_pose(axle, (right, left)).place(wheels)
            assert (
                np.linalg.norm(
                    by_joints(joints, (right, left), wheels) - exact, axis=1
                ).max()
                < 0.003
            )


@pytest.mark.parametrize("axle", AXLES)
def test_compression_raises_the_axle_and_a_compressed_left_strut_its_left_wheel(axle):
    joints = axle_joints(axle, -0.02, 0.0)
    wheels = np.stack([mirror(axle, side) * REAR_LEFT_TYRE for side in SIDES])
    rest = by_joints(joints, (-0.01, -0.01), wheels)
    assert (by_joints(joints, (-0.005, -0.005), wheels) - rest)[:, 2] == pytest.approx(
        [0.0126] * 2, rel=0.02
    )
    right, left = (by_joints(joints, (-0.012, -0.008), wheels) - rest)[:, 2]
    assert right < -0.008 and left > 0.008
