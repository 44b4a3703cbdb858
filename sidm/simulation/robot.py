"""The robot's rigid-body model as URDF: a chassis on two solid axles.

Each axle hangs on two revolute joints in series, heave and roll (`linkage`). The struts
act as torques on these joints (`suspension`). Bullet solves the stops of the heave and
the contacts of the tyres together.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sidm.simulation import dimensions as sizes
from sidm.simulation.dimensions import AXLES, SIDES, mirror
from sidm.simulation.linkage import AxleJoints
from sidm.simulation.suspension import Suspension
from sidm.systems import Robot

# Red, green and blue in pictures.
CHASSIS_COLOUR = "0.84 0.37 0.0"
TYRE_COLOUR = "0.25 0.25 0.27"
AXLE_COLOUR = "0.55 0.55 0.58"

#: kg, links and struts of one axle
LINKAGE_MASS = 2 * (sizes.LOWER_LINK_MASS + sizes.UPPER_LINK_MASS + sizes.STRUT_MASS)

# Names of the robot's joints.
HEAVES = tuple(f"{axle}_heave" for axle in AXLES)
ROLLS = tuple(f"{axle}_roll" for axle in AXLES)
WHEELS = tuple(f"{axle}_{side}_wheel" for axle in AXLES for side in SIDES)
KINGPINS = tuple(f"front_{side}_kingpin" for side in SIDES)


def _numbers(values) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _cylinder(radius: float, length: float) -> str:
    """A cylinder along y, for the argument `shape` of `_link`; lengths in m."""
    return (
        f'rpy="{np.pi / 2:.9g} 0 0"/>'
        f'<geometry><cylinder radius="{radius}" length="{length}"/></geometry>'
    )


def _link(
    name: str,
    mass: float,
    centre,
    inertia=(0.0, 0.0, 0.0),
    shape: str = "",
    colour: str = TYRE_COLOUR,
    solid: bool = True,
) -> str:
    """A URDF link whose frame is parallel to the body's.

    Mass is in kg, the centre of mass (3,) in m, inertia (3,) about it in kg m^2, 0 for
    parts that have none in the released simulator. `shape` is a URDF shape from its
    origin's rotation on; a part that is not `solid` is for pictures only.
    """
    ixx, iyy, izz = inertia
    origin = f'<origin xyz="{_numbers(centre)}"'
    moments = f'ixx="{ixx:.9g}" iyy="{iyy:.9g}" izz="{izz:.9g}" ixy="0" ixz="0" iyz="0"'
    material = f'<material name="{name}"><color rgba="{colour} 1"/></material>'
    shapes = f"<visual>{origin} {shape}{material}</visual>" if shape else ""
    shapes += f"<collision>{origin} {shape}</collision>" if shape and solid else ""
    return (
        f'<link name="{name}"><inertial>{origin}/><mass value="{mass:.9g}"/>'
        f"<inertia {moments}/></inertial>{shapes}</link>"
    )


def _joint(
    name: str, kind: str, parent: str, child: str, origin, axis, limits: str = ""
) -> str:
    """A URDF joint at `origin` (3,), m, in the parent's frame."""
    return (
        f'<joint name="{name}" type="{kind}">'
        f'<parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_numbers(origin)}"/><axis xyz="{_numbers(axis)}"/>'
        f"{limits}</joint>"
    )


def _axle(robot: Robot, axle: str, suspension: Suspension) -> list[str]:
    """Linkage, axle, hubs and tyres of the robot's 'rear' or 'front' axle."""
    scale, joints = robot.mass_scale, suspension.joints
    heave, roll, place = joints.heave_point, joints.roll_point, joints.pose.place
    # links and struts are one part, at their mean point, that moves with the heave
    links = place(
        mirror(axle, "left") * sizes.REAR_LEFT_RODS.mean(axis=(0, 1)) * (1, 0, 1)
    )
    middle = place(mirror(axle, "left") * sizes.REAR_AXLE)
    stops = [joints.heave_angle(x) for x in (robot.travel_lower, robot.travel_upper)]
    limits = (
        f'<limit lower="{min(stops):.9g}" upper="{max(stops):.9g}" '
        'effort="0" velocity="0"/>'
    )
    kind = "revolute" if suspension.heave_free else "fixed"
    linkage, name = f"{axle}_linkage", f"{axle}_axle"
    shape = _cylinder(0.012, 0.25)
    parts = [
        _joint(
            f"{axle}_heave", kind, "chassis", linkage, heave, joints.heave_axis, limits
        ),
        _link(linkage, scale * LINKAGE_MASS, links - heave),
        _joint(
            f"{axle}_roll", "continuous", linkage, name, roll - heave, joints.roll_axis
        ),
        _link(
            name,
            scale * sizes.AXLE_MASS,
            middle - roll,
            shape=shape,
            colour=AXLE_COLOUR,
            solid=False,
        ),
    ]
    for side in SIDES:
        parts += _wheel(robot, axle, side, joints)
    return parts


def _wheel(robot: Robot, axle: str, side: str, joints: AxleJoints) -> list[str]:
    """Hub and tyre of one wheel; a front hub turns about its kingpin."""
    scale, signs, place = robot.mass_scale, mirror(axle, side), joints.pose.place
    centre = place(signs * sizes.REAR_LEFT_HUB)
    tyre = place(signs * sizes.REAR_LEFT_TYRE)
    if axle == "front":
        kind, pivot = "continuous", place(sizes.FRONT_LEFT_KINGPIN * (1, signs[1], 1))
    else:
        kind, pivot = "fixed", centre
    origin = pivot - joints.roll_point
    axis = (
        joints.pose.rotation @ sizes.KINGPIN_AXIS / np.linalg.norm(sizes.KINGPIN_AXIS)
    )
    name = f"{axle}_{side}"
    hub, wheel, spin = f"{name}_hub", f"{name}_tyre", (0, 1, 0)
    inertia = tuple(scale * moment for moment in sizes.TYRE_INERTIA)
    shape = _cylinder(sizes.TYRE_RADIUS, sizes.TYRE_WIDTH)
    return [
        _joint(f"{name}_kingpin", kind, f"{axle}_axle", hub, origin, axis),
        _link(hub, scale * sizes.HUB_MASS, centre - pivot),
        _joint(f"{name}_wheel", "continuous", hub, wheel, tyre - pivot, spin),
        _link(wheel, scale * sizes.TYRE_MASS, (0, 0, 0), inertia, shape),
    ]


def urdf(robot: Robot, suspensions: Mapping[str, Suspension]) -> str:
    """The robot as URDF text, with joints HEAVES, ROLLS, WHEELS and KINGPINS."""
    size = _numbers(sizes.CHASSIS_SIZE)
    box = f'rpy="0 0 0"/><geometry><box size="{size}"/></geometry>'
    mass, inertia = sizes.CHASSIS_MASS, sizes.CHASSIS_INERTIA
    parts = [_link("chassis", mass, (0, 0, 0), inertia, box, CHASSIS_COLOUR)]
    for axle in AXLES:
        parts += _axle(robot, axle, suspensions[axle])
    lines = ['<?xml version="1.0"?>', '<robot name="rover">', *parts, "</robot>", ""]
    return "\n".join(lines)
