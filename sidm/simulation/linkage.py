"""The suspension's geometry: how an axle moves against the chassis, from the points of its links. Pure functions.

Four links leave an axle two freedoms. In heave both its struts move alike, in roll
oppositely; in each the axle turns, to first order, about a line fixed in the chassis.
Small motions are twists (6,): a turn w, rad, and the velocity v, m, of the axle's point
at the chassis' origin. All in the body frame of `dimensions`.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from sidm.simulation.dimensions import REAR_AXLE, REAR_LEFT_RODS, SIDES, mirror

REACH = (-0.06, 0.02)  # m: farther out the struts pass a dead point


class Pose(NamedTuple):
    """Where an axle stands, against where it stands with both struts at zero: turned, then shifted."""

    rotation: np.ndarray  # (3, 3)
    shift: np.ndarray  # (3,), m

    def place(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3), m, of the axle at zero, where they are now."""
        return points @ self.rotation.T + self.shift


class AxleJoints(NamedTuple):
    """Two revolute joints in series, chassis to axle, that stand for the links of an axle."""

    pose: Pose  # of the axle at zero joint angles
    heave_axis: np.ndarray  # (3,), a unit vector
    heave_point: np.ndarray  # (3,), m, on the axis
    #: mean strut travel, m, as a polynomial of the angle, highest power first
    heave_travel: tuple[float, float, float]
    roll_axis: np.ndarray  # (3,), a unit vector
    roll_point: np.ndarray  # (3,), m, on the axis
    #: rad a metre of (left - right) / 2, as a polynomial of the mean travel, m
    roll_rates: tuple[float, float]

    def heave_angle(self, travel: float) -> float:
        """The heave joint's angle, rad, at a mean strut travel, m."""
        a, b, c = self.heave_travel
        rest = c - travel
        return -2 * rest / (b + math.sqrt(b * b - 4 * a * rest))

    def mean_travel(self, heave_angle: float) -> float:
        """The mean travel of the struts, m, at an angle of the heave joint, rad."""
        a, b, c = self.heave_travel
        return (a * heave_angle + b) * heave_angle + c

    def roll_rate(self, travel: float) -> float:
        """Roll, rad, a metre of half the difference of left and right travel, at a mean travel, m."""
        growth, rate = self.roll_rates
        return growth * travel + rate


def rods(axle: str) -> np.ndarray:
    """Ends on axle and chassis, m, of an axle's six rods (6, 2, 3): lower links, upper links, struts; right, left."""
    return np.concatenate(
        [[mirror(axle, side) * rod for side in SIDES] for rod in REAR_LEFT_RODS]
    )


def _lengths(ends: np.ndarray, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Of rods with the given ends (6, 2, 3): length (6,), m, and how a twist (w, v) lengthens each (6, 6)."""
    points = pose.place(ends[:, 0])
    outward = points - ends[:, 1]
    length = np.linalg.norm(outward, axis=1)
    unit = outward / length[:, None]
    return length, np.hstack([np.cross(points, unit), unit])


def twists(axle: str, pose: Pose) -> np.ndarray:
    """The axle's twists (2, 6) a metre of travel of its right and of its left strut, from where it stands.

    A twist (w, v) lengthens a rod with unit vector u at the point p of the axle by u .
    (v + w x p). Four rods keep their length and the two struts shorten at given rates:
    six equations for the six numbers.
    """
    _, lengthening = _lengths(rods(axle), pose)
    return np.linalg.solve(lengthening, -np.eye(6)[:, 4:]).T


def axle_pose(axle: str, travel: tuple[float, float]) -> Pose:
    """Where an axle stands at the travels, m, of its right and left strut: the closed linkage, by Newton's method.

    Raises:
        ValueError: the links cannot reach it.
    """
    ends = rods(axle)
    wanted = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    wanted[4:] -= travel
    pose = Pose(np.eye(3), np.zeros(3))
    for _ in range(20):
        length, lengthening = _lengths(ends, pose)
        miss = wanted - length
        if np.abs(miss).max() < 1e-12:
            return pose
        try:
            step = np.linalg.solve(lengthening, miss)
        except (
            np.linalg.LinAlgError
        ):  # a dead point; whether a far pose is one to the last bit, rounding decides
            break
        turn = Rotation.from_rotvec(step[:3]).as_matrix()
        pose = Pose(turn @ pose.rotation, turn @ pose.shift + step[3:])
    right, left = map(float, travel)
    raise ValueError(
        f"the links of the {axle} axle cannot reach strut travels of {right} and {left} m"
    )


@functools.cache  # a collector builds thousands of the same robot
def axle_joints(axle: str, lower: float, upper: float) -> AxleJoints:
    """The joints of an axle whose struts travel from `lower` to `upper`, m: heave first, carrying roll.

    The two lines are those at the middle of the travel. As they move with the heave, a
    strut's travel is not quite proportional to the heave's angle, nor the roll to the
    struts' difference: the polynomials follow that.

    Raises:
        ValueError: travel beyond REACH.
    """
    if lower < REACH[0] or upper > REACH[1]:
        raise ValueError(
            f"the links allow strut travels from {REACH[0]} to {REACH[1]} m, not {lower} to {upper} m"
        )
    middle = (lower + upper) / 2
    pose = axle_pose(axle, (middle, middle))
    right, left = twists(axle, pose)
    heave_axis, heave_point, _ = _line(right + left)
    roll_axis, roll_point, _ = _line(left - right)
    centre = mirror(axle, "left") * REAR_AXLE

    def angle(travel: float) -> float:
        arms = (
            pose.place(centre) - heave_point,
            axle_pose(axle, (travel, travel)).place(centre) - heave_point,
        )
        return np.arctan2(heave_axis @ np.cross(*arms), np.dot(*arms))

    def rate(travel: float) -> float:
        right, left = twists(axle, axle_pose(axle, (travel, travel)))
        return _line(left - right)[2]

    travels = middle + np.linspace(-1, 1, 9) * max(upper - middle, 1e-3)
    heave_travel = np.polyfit(
        [angle(travel) for travel in travels], travels, 2
    ).tolist()
    roll_rates = np.polyfit(travels, [rate(travel) for travel in travels], 1).tolist()
    return AxleJoints(
        pose,
        heave_axis,
        heave_point,
        tuple(heave_travel),
        roll_axis,
        roll_point,
        tuple(roll_rates),
    )


def _line(twist: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """The line that a twist without pitch turns about: unit vector (3,), its point nearest the origin (3,), and |w|."""
    turn, shift = twist[:3], twist[3:]
    rate = float(np.linalg.norm(turn))
    return turn / rate, np.cross(turn, shift) / rate**2, rate
