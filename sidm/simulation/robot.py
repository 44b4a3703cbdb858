"""The robot's rigid-body model, built from its figures: a chassis on two sprung solid axles, written as URDF.

Each axle hangs on four links and two struts. The four links leave it two freedoms against the chassis, and the two
struts measure them: to first order, a millimetre of travel of one strut, the other held, turns the axle about a fixed
line. So each axle is two revolute joints in series, one a strut: the joint's angle is the strut's travel times a rate,
its limits are the strut's stops, its torque is the strut's force. Bullet then solves stops and tyre contacts together.

Body frame: x forward, y left, z up, origin at the chassis' centre of mass. Figures: the authors' released model.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sidm.systems import Robot

# Masses, kg, and inertias about the centre of mass, kg m^2.
CHASSIS_MASS, CHASSIS_INERTIA = 1.20456, (0.00293, 0.01701, 0.01885)
AXLE_MASS, HUB_MASS, TYRE_MASS = 0.0970, 0.1954, 2.65072
LINKAGE_MASS = 2 * (0.0118 + 0.0200 + 2 * 0.0112)  # of an axle: lower and upper links, struts
TYRE_INERTIA = (0.01141, 0.01875, 0.01141)  # the second about the axle

# Sizes, m.
CHASSIS_SIZE = (0.403, 0.152, 0.072)
TYRE_RADIUS, TYRE_WIDTH = 0.100, 0.090

# Points of the rear axle's left half, m; mirror y for the right, x for the front.
REAR_AXLE = np.array([-0.3381, 0.0, -0.0669])
REAR_LEFT_HUB = np.array([-0.3427, 0.1225, -0.0740])
REAR_LEFT_TYRE = np.array([-0.3427, 0.1800, -0.0740])
REAR_LEFT_RODS = np.array(  # (rod, end on the axle then on the chassis, xyz): lower link, upper link, strut
    [
        [(-0.3225, 0.0708, -0.0852), (-0.1010, 0.0615, -0.0240)],
        [(-0.3159, 0.0160, -0.0139), (-0.1250, 0.0445, 0.0139)],
        [(-0.3182, 0.0920, -0.0688), (-0.1895, 0.0710, 0.0240)],
    ]
)
FRONT_LEFT_KINGPIN = np.array([0.3427, 0.1150, -0.0740])
KINGPIN_AXIS = np.array([0.255, -0.264, -0.930])  # the same left and right; positive steering turns right

CHASSIS_COLOUR, TYRE_COLOUR, AXLE_COLOUR = "0.84 0.37 0.0", "0.25 0.25 0.27", "0.55 0.55 0.58"  # in pictures

AXLES, SIDES = ("rear", "front"), ("right", "left")
STRUTS = tuple(f"{axle}_{side}_strut" for axle in AXLES for side in SIDES)  # joints, as `strut_positions` has them
WHEELS = tuple(f"{axle}_{side}_wheel" for axle in AXLES for side in SIDES)
KINGPINS = tuple(f"front_{side}_kingpin" for side in SIDES)


class StrutJoint(NamedTuple):
    """The revolute joint that stands for one strut."""

    axis: np.ndarray  # (3,) unit vector, body frame
    point: np.ndarray  # (3,) on the axis, m, body frame
    rate: float  # rad of joint angle a metre of strut travel


def mirror(axle: str, side: str) -> np.ndarray:
    """Signs that take a point of the rear left quarter to the named one."""
    return np.array([1.0 if axle == "rear" else -1.0, 1.0 if side == "left" else -1.0, 1.0])


def strut_joints(axle: str) -> dict[str, StrutJoint]:
    """The axes about which an axle turns when one strut moves and the other is held, from the linkage's points.

    A small motion of the axle, turning by w about the chassis' origin and moving by v, lengthens a rod with unit vector
    u at the point p of the axle by u . (v + w x p). Four rods keep their length and the two struts shorten at given
    rates: six equations for the six numbers (w, v).
    """
    signs = np.stack([mirror(axle, side) for side in SIDES])
    rods = (signs[:, None, None] * REAR_LEFT_RODS).transpose(1, 0, 2, 3).reshape(6, 2, 3)  # struts last: right, left
    outward = rods[:, 0] - rods[:, 1]
    unit = outward / np.linalg.norm(outward, axis=1, keepdims=True)
    lengthening = np.hstack([np.cross(rods[:, 0], unit), unit])  # (6 rods, 6 of (w, v))
    joints = {}
    for i, side in enumerate(SIDES):
        motion = np.linalg.solve(lengthening, -np.eye(6)[4 + i])
        turn, shift = motion[:3], motion[3:]
        rate = float(np.linalg.norm(turn))
        # The screw's pitch, 7 mm a radian, is left out: over the whole travel it moves the axle by less than 3 mm.
        joints[side] = StrutJoint(turn / rate, np.cross(turn, shift) / rate**2, rate)
    return joints


STRUT_RATES = np.array([strut_joints(axle)[side].rate for axle in AXLES for side in SIDES])  # rad/m, in STRUTS' order


def _numbers(values) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _cylinder(radius: float, length: float) -> str:
    """The rest of a URDF shape after its origin's place: a cylinder along y."""
    return f'rpy="{np.pi / 2:.9g} 0 0"/><geometry><cylinder radius="{radius}" length="{length}"/></geometry>'


def _link(
    name: str, mass: float, centre, inertia=(0.0, 0.0, 0.0),
    shape: str = "", colour: str = TYRE_COLOUR, solid: bool = True,
) -> str:
    """A URDF link whose frame is parallel to the body's; `centre` (3,) is its centre of mass in that frame.

    Parts without inertia of their own have none in the released simulator either. A `shape` that is not `solid` is for
    pictures alone.
    """
    ixx, iyy, izz = inertia
    form = f'<origin xyz="{_numbers(centre)}" {shape}'
    paint = f'<material name="{name}"><color rgba="{colour} 1"/></material>'
    shapes = f"<visual>{form}{paint}</visual>" if shape else ""
    shapes += f"<collision>{form}</collision>" if shape and solid else ""
    return (
        f'<link name="{name}"><inertial><origin xyz="{_numbers(centre)}"/><mass value="{mass:.9g}"/>'
        f'<inertia ixx="{ixx:.9g}" iyy="{iyy:.9g}" izz="{izz:.9g}" ixy="0" ixz="0" iyz="0"/></inertial>{shapes}</link>'
    )


def _joint(name: str, kind: str, parent: str, child: str, origin, axis, limits: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_numbers(origin)}"/><axis xyz="{_numbers(axis)}"/>{limits}</joint>'
    )


def _axle(robot: Robot, axle: str) -> list[str]:
    """Linkage, axle, hubs and tyres of one end of the robot."""
    scale = robot.mass_scale
    right, left = strut_joints(axle)["right"], strut_joints(axle)["left"]
    middle = mirror(axle, "left") * REAR_LEFT_RODS.mean(axis=(0, 1)) * (1, 0, 1)  # of the links, half sprung

    def limits(rate: float) -> str:
        lower, upper = robot.travel_lower * rate, robot.travel_upper * rate
        return f'<limit lower="{lower:.9g}" upper="{upper:.9g}" effort="0" velocity="0"/>'

    parts = [
        _joint(
            f"{axle}_right_strut", "revolute", "chassis", f"{axle}_linkage", right.point, right.axis, limits(right.rate)
        ),
        _link(f"{axle}_linkage", scale * LINKAGE_MASS, middle - right.point),
        _joint(
            f"{axle}_left_strut", "revolute", f"{axle}_linkage", f"{axle}_axle",
            left.point - right.point, left.axis, limits(left.rate),
        ),
        _link(
            f"{axle}_axle", scale * AXLE_MASS, mirror(axle, "left") * REAR_AXLE - left.point,
            shape=_cylinder(0.012, 0.25), colour=AXLE_COLOUR, solid=False,
        ),
    ]
    for side in SIDES:
        parts += _wheel(robot, axle, side, left.point)
    return parts


def _wheel(robot: Robot, axle: str, side: str, axle_frame: np.ndarray) -> list[str]:
    """Hub and tyre of one wheel; the front hubs turn about their kingpins."""
    scale, signs = robot.mass_scale, mirror(axle, side)
    hub, tyre = signs * REAR_LEFT_HUB, signs * REAR_LEFT_TYRE
    name = f"{axle}_{side}"
    pivot = FRONT_LEFT_KINGPIN * (1, signs[1], 1) if axle == "front" else hub
    kind = "continuous" if axle == "front" else "fixed"
    axis = KINGPIN_AXIS / np.linalg.norm(KINGPIN_AXIS)
    return [
        _joint(f"{name}_kingpin", kind, f"{axle}_axle", f"{name}_hub", pivot - axle_frame, axis),
        _link(f"{name}_hub", scale * HUB_MASS, hub - pivot),
        _joint(f"{name}_wheel", "continuous", f"{name}_hub", f"{name}_tyre", tyre - pivot, (0, 1, 0)),
        _link(
            f"{name}_tyre", scale * TYRE_MASS, (0, 0, 0), tuple(scale * i for i in TYRE_INERTIA),
            _cylinder(TYRE_RADIUS, TYRE_WIDTH),
        ),
    ]


def urdf(robot: Robot) -> str:
    """The robot as URDF text; joints are named in STRUTS, WHEELS and KINGPINS."""
    box = f'rpy="0 0 0"/><geometry><box size="{_numbers(CHASSIS_SIZE)}"/></geometry>'
    parts = [_link("chassis", CHASSIS_MASS, (0, 0, 0), CHASSIS_INERTIA, box, CHASSIS_COLOUR)]
    for axle in AXLES:
        parts += _axle(robot, axle)
    return "\n".join(['<?xml version="1.0"?>', '<robot name="rover">', *parts, "</robot>", ""])
