"""The robot's rigid-body model, built from its figures: a chassis on two solid axles, written as URDF.

Each axle hangs on two revolute joints in series, heave and roll (`linkage`); what its
struts push with is a torque on those joints (`suspension`). Bullet solves the stops of
the heave and the tyres' contacts together.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sidm.simulation.dimensions import (
    AXLE_MASS,
    AXLES,
    CHASSIS_INERTIA,
    CHASSIS_MASS,
    CHASSIS_SIZE,
    FRONT_LEFT_KINGPIN,
    HUB_MASS,
    KINGPIN_AXIS,
    LOWER_LINK_MASS,
    REAR_AXLE,
    REAR_LEFT_HUB,
    REAR_LEFT_RODS,
    REAR_LEFT_TYRE,
    SIDES,
    STRUT_MASS,
    TYRE_INERTIA,
    TYRE_MASS,
    TYRE_RADIUS,
    TYRE_WIDTH,
    UPPER_LINK_MASS,
    mirror,
)
from sidm.simulation.linkage import AxleJoints
from sidm.simulation.suspension import Suspension
from sidm.systems import Robot

#: in pictures
CHASSIS_COLOUR, TYRE_COLOUR, AXLE_COLOUR = (
    "0.84 0.37 0.0",
    "0.25 0.25 0.27",
    "0.55 0.55 0.58",
)

LINKAGE_MASS = 2 * (LOWER_LINK_MASS + UPPER_LINK_MASS + STRUT_MASS)  # of an axle

HEAVES, ROLLS = (
    tuple(f"{axle}_heave" for axle in AXLES),
    tuple(f"{axle}_roll" for axle in AXLES),
)
WHEELS = tuple(f"{axle}_{side}_wheel" for axle in AXLES for side in SIDES)
KINGPINS = tuple(f"front_{side}_kingpin" for side in SIDES)


def _numbers(values) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _cylinder(radius: float, length: float) -> str:
    """The rest of a URDF shape after its origin's place: a cylinder along y."""
    return f'rpy="{np.pi / 2:.9g} 0 0"/><geometry><cylinder radius="{radius}" length="{length}"/></geometry>'


def _link(
    name: str,
    mass: float,
    centre,
    inertia=(0.0, 0.0, 0.0),
    shape: str = "",
    colour: str = TYRE_COLOUR,
    solid: bool = True,
) -> str:
    """A URDF link whose frame is parallel to the body's; `centre` (3,) is its centre of mass in that frame.

    Parts without inertia of their own have none in the released simulator either. A
    `shape` that is not `solid` is for pictures alone.
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


def _joint(
    name: str, kind: str, parent: str, child: str, origin, axis, limits: str = ""
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_numbers(origin)}"/><axis xyz="{_numbers(axis)}"/>{limits}</joint>'
    )


def _axle(robot: Robot, axle: str, suspension: Suspension) -> list[str]:
    """Linkage, axle, hubs and tyres of one end of the robot."""
    scale, joints = robot.mass_scale, suspension.joints
    heave, roll, place = joints.heave_point, joints.roll_point, joints.pose.place
    # Links and struts are one part, in their middle, that goes with the heave.
    links = place(mirror(axle, "left") * REAR_LEFT_RODS.mean(axis=(0, 1)) * (1, 0, 1))
    angles = [
        joints.heave_angle(travel)
        for travel in (robot.travel_lower, robot.travel_upper)
    ]
    limits = f'<limit lower="{min(angles):.9g}" upper="{max(angles):.9g}" effort="0" velocity="0"/>'
    kind = "revolute" if suspension.heave_free else "fixed"
    parts = [
        _joint(
            f"{axle}_heave",
            kind,
            "chassis",
            f"{axle}_linkage",
            heave,
            joints.heave_axis,
            limits,
        ),
        _link(f"{axle}_linkage", scale * LINKAGE_MASS, links - heave),
        _joint(
            f"{axle}_roll",
            "continuous",
            f"{axle}_linkage",
            f"{axle}_axle",
            roll - heave,
            joints.roll_axis,
        ),
        _link(
            f"{axle}_axle",
            scale * AXLE_MASS,
            place(mirror(axle, "left") * REAR_AXLE) - roll,
            shape=_cylinder(0.012, 0.25),
            colour=AXLE_COLOUR,
            solid=False,
        ),
    ]
    for side in SIDES:
        parts += _wheel(robot, axle, side, joints, roll)
    return parts


def _wheel(
    robot: Robot, axle: str, side: str, joints: AxleJoints, frame: np.ndarray
) -> list[str]:
    """Hub and tyre of one wheel, `frame` (3,) being the axle's; the front hubs turn about their kingpins."""
    scale, signs, place = robot.mass_scale, mirror(axle, side), joints.pose.place
    hub, tyre = place(signs * REAR_LEFT_HUB), place(signs * REAR_LEFT_TYRE)
    name = f"{axle}_{side}"
    pivot = place(FRONT_LEFT_KINGPIN * (1, signs[1], 1)) if axle == "front" else hub
    kind = "continuous" if axle == "front" else "fixed"
    axis = joints.pose.rotation @ KINGPIN_AXIS / np.linalg.norm(KINGPIN_AXIS)
    return [
        _joint(
            f"{name}_kingpin", kind, f"{axle}_axle", f"{name}_hub", pivot - frame, axis
        ),
        _link(f"{name}_hub", scale * HUB_MASS, hub - pivot),
        _joint(
            f"{name}_wheel",
            "continuous",
            f"{name}_hub",
            f"{name}_tyre",
            tyre - pivot,
            (0, 1, 0),
        ),
        _link(
            f"{name}_tyre",
            scale * TYRE_MASS,
            (0, 0, 0),
            tuple(scale * i for i in TYRE_INERTIA),
            _cylinder(TYRE_RADIUS, TYRE_WIDTH),
        ),
    ]


def urdf(robot: Robot, suspensions: Mapping[str, Suspension]) -> str:
    """The robot as URDF text, on the suspensions of its axles; HEAVES, ROLLS, WHEELS and KINGPINS name its joints."""
    box = f'rpy="0 0 0"/><geometry><box size="{_numbers(CHASSIS_SIZE)}"/></geometry>'
    parts = [
        _link("chassis", CHASSIS_MASS, (0, 0, 0), CHASSIS_INERTIA, box, CHASSIS_COLOUR)
    ]
    for axle in AXLES:
        parts += _axle(robot, axle, suspensions[axle])
    return "\n".join(
        ['<?xml version="1.0"?>', '<robot name="rover">', *parts, "</robot>", ""]
    )
