"""The robot's model: its linkage against the closed loops, its masses against the table."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from sidm.simulation.robot import AXLES, REAR_LEFT_RODS, SIDES, STRUT_RATES, STRUTS, mirror, strut_joints, urdf
from sidm.systems import SYSTEMS

ROBOTS = SYSTEMS["system1"]


def axle_pose(axle, travel):
    """Turn and shift (6,) of the axle for strut travels (right, left), m, from the six lengths of links and struts."""
    rods = np.stack([mirror(axle, side) * rod for rod in REAR_LEFT_RODS for side in SIDES])  # (6, 2, 3)
    length = np.linalg.norm(rods[:, 0] - rods[:, 1], axis=1)
    wanted = length - np.r_[0, 0, 0, 0, travel]

    def miss(pose):
        moved = Rotation.from_rotvec(pose[:3]).apply(rods[:, 0]) + pose[3:]
        return np.linalg.norm(moved - rods[:, 1], axis=1) - wanted

    pose = fsolve(miss, np.zeros(6), xtol=1e-12)
    assert np.abs(miss(pose)).max() < 1e-10
    return pose


def joint_pose(axle, travel):
    """The same from the two revolute joints in series."""
    joints, points = strut_joints(axle), np.vstack([np.eye(3), np.zeros(3)])
    for side, q in zip(reversed(SIDES), reversed(travel), strict=True):  # the left joint is nearer to the axle
        joint = joints[side]
        turn = Rotation.from_rotvec(joint.axis * joint.rate * q)
        points = turn.apply(points - joint.point) + joint.point
    return points


@pytest.mark.parametrize("axle", AXLES)
@pytest.mark.parametrize("travel", [(1e-5, 0.0), (0.0, 1e-5), (1e-5, 1e-5), (-1e-5, 1e-5)])
def test_small_motions_are_those_of_the_closed_linkage(axle, travel):
    pose = axle_pose(axle, np.array(travel))
    exact = Rotation.from_rotvec(pose[:3]).apply(np.vstack([np.eye(3), np.zeros(3)])) + pose[3:]
    motion = np.abs(exact - np.vstack([np.eye(3), np.zeros(3)])).max()
    pitch = 0.0070 * STRUT_RATES[0] * np.abs(travel).sum()  # of the screws, left out
    assert np.abs(joint_pose(axle, travel) - exact).max() < pitch + 0.005 * motion


@pytest.mark.parametrize("axle", AXLES)
def test_over_the_whole_travel_the_wheels_stay_within_11_millimetres(axle):
    wheels = np.stack([mirror(axle, side) * (-0.3427, 0.18, -0.074) for side in SIDES])
    for travel in [(-0.02, -0.02), (-0.02, 0.0), (0.0, -0.02), (-0.01, 0.003)]:
        pose = axle_pose(axle, np.array(travel))
        exact = Rotation.from_rotvec(pose[:3]).apply(wheels) + pose[3:]
        points = joint_pose(axle, travel)
        turn, shift = (points[:3] - points[3]).T, points[3]
        assert np.abs(wheels @ turn.T + shift - exact).max() < 0.011


def test_strut_rates_agree_with_the_stated_heave_and_roll():
    # facts of the robot: 0.2032 m a rad of heave, 0.0273 m a rad of roll
    expected = np.hypot(1 / (2 * 0.2032), 1 / (2 * 0.0273))
    assert pytest.approx([expected] * 4, rel=2e-3) == STRUT_RATES.tolist()


@pytest.mark.parametrize(("robot", "total"), [(ROBOTS.novice, 13.0), (ROBOTS.expert, 1.20456 + 1.5 * 11.79)])
def test_masses_add_up(robot, total):
    tree = ElementTree.fromstring(urdf(robot))
    masses = [float(mass.get("value")) for mass in tree.iter("mass")]
    assert sum(masses) == pytest.approx(total, rel=0.01)
    assert {joint.get("name") for joint in tree.iter("joint")} >= set(STRUTS)
