"""The suspension's geometry: how an axle moves relative to the chassis.

Pure functions compute the motion from the ends of the axle's links. Four links leave an
axle two degrees of freedom: in heave its struts move alike, in roll oppositely. In each
the axle turns, to first order, about a line fixed in the chassis.

A small motion is a twist (w, v), (6,): a rotation w, rad, and the displacement v, m, of
the axle's point at the chassis' origin. All quantities are in the body frame of
`dimensions`.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from sidm.simulation.dimensions import REAR_AXLE, REAR_LEFT_RODS, SIDES, mirror

REACH = (-0.06, 0.02)  # m, strut travel; beyond it the linkage passes a dead point


class Pose(NamedTuple):
    """Rotation, then shift, of an axle from its pose with both struts at zero."""

    rotation: np.ndarray  # (3, 3)
    shift: np.ndarray  # (3,), m

    def place(self, points: np.ndarray) -> np.ndarray:
        """Present positions (..., 3), m, of axle points given at zero travel."""
        return points @ self.rotation.T + self.shift


class AxleJoints(NamedTuple):
    """Two revolute joints, from chassis to axle, that replace the links of an axle."""

    pose: Pose  # the axle's, at zero joint angles
    heave_axis: np.ndarray  # (3,), a unit vector
    heave_point: np.ndarray  # (3,), m, on the axis
    #: mean strut travel, m: a polynomial of the joint's angle, highest power first
    heave_travel: tuple[float, float, float]
    roll_axis: np.ndarray  # (3,), a unit vector
    roll_point: np.ndarray  # (3,), m, on the axis
    #: roll, rad, per metre of (left - right) / 2: a polynomial of the mean travel, m
    roll_rates: tuple[float, float]

    def heave_angle(self, travel: float) -> float:
        """The heave joint's angle, rad, at a mean travel of the struts, m."""
        a, b, c = self.heave_travel
        rest = c - travel
        return -2 * rest / (b + math.sqrt(b * b - 4 * a * rest))

    def mean_travel(self, heave_angle: float) -> float:
        """The struts' mean travel, m, at an angle of the heave joint, rad."""
        a, b, c = self.heave_travel
        return (a * heave_angle + b) * heave_angle + c

    def roll_rate(self, travel: float) -> float:
        """Roll, rad/m, per (left - right) / 2 at a mean travel of the struts, m."""
        growth, rate = self.roll_rates
        return growth * travel + rate


def rods(axle: str) -> np.ndarray:
    """Ends (6, 2, 3), m, of an axle's six rods, on the axle and on the chassis.

    The rods are the lower links, the upper links and the struts; of each, first the
    right one and then the left one.
    """
    return np.concatenate(
        [[mirror(axle, side) * rod for side in SIDES] for rod in REAR_LEFT_RODS]
    )


def _lengths(ends: np.ndarray, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Lengths (6,), m, of rods, and their derivatives (6, 6) by a twist (w, v)."""
    points = pose.place(ends[:, 0])
    outward = points - ends[:, 1]
    length = np.linalg.norm(outward, axis=1)
    unit = outward / length[:, None]
    return length, np.hstack([np.cross(points, unit), unit])


def twists(axle: str, pose: Pose) -> np.ndarray:
    """Twists (2, 6) of an axle per metre of travel of its right and its left strut.

    A twist (w, v) lengthens a rod with unit vector u at the axle's point p by
    u . (v + w x p). Four rods keep their length and the two struts shorten at given
    rates: six equations for the six numbers.
    """
    _, lengthening = _lengths(rods(axle), pose)
    return np.linalg.solve(lengthening, -np.eye(6)[:, 4:]).T


def axle_pose(axle: str, travel: tuple[float, float]) -> Pose:
    """The pose of an axle at travels (right, left), m, with links closed by Newton."""
    ends = rods(axle)
    wanted = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    wanted[4:] -= travel
    pose = Pose(np.eye(3), np.zeros(3))
    for _ in range(20):
        length, lengthening = _lengths(ends, pose)
        error = wanted - length
        if np.abs(error).max() < 1e-12:
            return pose
        try:
            step = np.linalg.solve(lengthening, error)
        except np.linalg.LinAlgError:  # a dead point; near one, rounding decides
            break
        turn = Rotation.from_rotvec(step[:3]).as_matrix()
        pose = Pose(turn @ pose.rotation, turn @ pose.shift + step[3:])
    right, left = map(float, travel)
    raise ValueError(
        f"the links of the {axle} axle cannot reach "
        f"strut travels of {right} and {left} m"
    )


@functools.cache  # a worker builds the same robot thousands of times
def axle_joints(axle: str, lower: float, upper: float) -> AxleJoints:
    """The joints of an axle with strut travels from `lower` to `upper`, m.

    The joints' axes are those at the middle of the struts' travel. In the linkage the
    axes move with the heave, so a strut's travel is not quite proportional to the
    heave's angle, nor the roll to the difference of the travels. Polynomials follow
    these relations.
    """
    if lower < REACH[0] or upper > REACH[1]:
        raise ValueError(
            f"the links allow strut travels from {REACH[0]} to {REACH[1]} m, "
            f"not {lower} to {upper} m"
        )
    middle = (lower + upper) / 2
    pose = axle_pose(axle, (middle, middle))
    right, left = twists(axle, pose)
    heave_axis, heave_point, _ = _line(right + left)
    roll_axis, roll_point, _ = _line(left - right)
    centre = mirror(axle, "left") * REAR_AXLE

    travels = middle + np.linspace(-1, 1, 9) * max(upper - middle, 1e-3)
    poses = [axle_pose(axle, (travel, travel)) for travel in travels]

    def heave_angle(moved: Pose) -> float:
        arms = [at.place(centre) - heave_point for at in (pose, moved)]
        return np.arctan2(heave_axis @ np.cross(*arms), np.dot(*arms))

    def roll_rate(moved: Pose) -> float:
        right, left = twists(axle, moved)
        return _line(left - right)[2]

    heave_travel = np.polyfit([heave_angle(moved) for moved in poses], travels, 2)
    roll_rates = np.polyfit(travels, [roll_rate(moved) for moved in poses], 1)
    return AxleJoints(
        pose,
        heave_axis,
        heave_point,
        tuple(heave_travel.tolist()),
        roll_axis,
        roll_point,
        tuple(roll_rates.tolist()),
    )


def _line(twist: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """A line's unit vector (3,), its point nearest to the origin (3,), and |w|."""
    turn, shift = twist[:3], twist[3:]
    rate = float(np.linalg.norm(turn))
    return turn / rate, np.cross(turn, shift) / rate**2, rate
