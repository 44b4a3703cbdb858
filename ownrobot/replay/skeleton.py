"""Skeletons: the parts and rods that a drawn robot is made of.

A skeleton is a mapping of JSON types, which static/robot.js draws. It has `parts`,
which turn on one another and have shapes, and `rods`: links, and struts with their
springs. The first part is the body; all others name an earlier part as their `parent`.
A part stands `at` a point of its parent's frame, m. A part with a `joint` turns about
`axis`; `joint` is the column of a track's joints that has the angle, rad. A rod
connects points of two parts. Body frame: x ahead, y left, z up.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from sidm.config import ConfigError, unknown_name
from sidm.systems import Physics, Robot

Skeleton = Mapping[str, Any]


class Box(NamedTuple):
    """Dimensions, m, of a robot on four wheels without suspension."""

    size: tuple[float, float, float]  # of the body: length, width, height
    wheelbase: float
    track: float  # distance between left and right wheels
    radius: float  # of the wheels
    width: float  # of a tyre
    clearance: float  # height of the body's lower side above the ground


#: Clearpath's robots: published dimensions, rounded to cm.
BOXES = {
    "warthog": Box((1.30, 0.84, 0.42), 0.91, 1.13, 0.30, 0.24, 0.26),
    "husky": Box((0.90, 0.44, 0.24), 0.51, 0.57, 0.17, 0.11, 0.13),
}


def find_box(shape: str) -> Box:
    """Dimensions of a robot by a name in BOXES, or by 'WHEELBASE,TRACK,RADIUS' in m.

    From these follow the sizes of body and tyres. Others raise ConfigError.
    """
    if shape in BOXES:
        return BOXES[shape]
    try:
        base, track, radius = map(float, shape.split(","))
    except ValueError:
        unknown = unknown_name(shape, BOXES, kind="shape")
        raise ConfigError(f"{unknown}, or WHEELBASE,TRACK,RADIUS in m") from None
    if not all(0 < length < math.inf for length in (base, track, radius)):
        raise ConfigError(
            f"wheelbase, track and radius are positive lengths in m, not '{shape}'"
        )
    size = (1.3 * base, 0.6 * track, 1.2 * radius)
    return Box(size, base, track, radius, 0.25 * track, 0.9 * radius)


def _rounded(values: Any) -> Any:
    """Coordinates of a point or a vector as a list, to 0.1 mm."""
    return np.round(values, 4).tolist()


def _body(size: Iterable[float], height: float = 0) -> dict[str, Any]:
    """The first part of a skeleton."""
    return {"at": [0, 0, height], "shapes": [{"kind": "body", "size": list(size)}]}


def _turning(parent: int, at: Any, axis: Any, joint: int) -> dict[str, Any]:
    """A part that turns about an axis."""
    return {
        "parent": parent,
        "at": _rounded(at),
        "axis": _rounded(axis),
        "joint": joint,
    }


def _wheel(
    parent: int, at: Any, joint: int, radius: float, width: float, side: float
) -> dict[str, Any]:
    """A part with a tyre; `side` is 1 on the left and -1 on the right."""
    tyre = {"kind": "tyre", "radius": radius, "width": width, "side": side}
    return _turning(parent, at, (0, 1, 0), joint) | {"shapes": [tyre]}


def box_skeleton(box: Box, on_ground: bool = True) -> Skeleton:
    """Skeleton of a robot without suspension.

    Its joints are the wheels: rear right, rear left, front right, front left. Its frame
    is on the ground between the wheels, or in the middle of the body.
    """
    height = box.clearance + box.size[2] / 2
    parts = [_body(box.size, height if on_ground else 0)]
    for joint, (end, side) in enumerate([(-1, -1), (-1, 1), (1, -1), (1, 1)]):
        hub = (end * box.wheelbase / 2, side * box.track / 2, box.radius - height)
        parts.append(_wheel(0, hub, joint, box.radius, box.width, side))
    return {"parts": parts, "rods": []}


def rover_skeleton(robot: Robot, strut_motors: bool = True) -> Skeleton:
    """Skeleton of a robot of the paper, with the joints of `Simulator.joint_angles`.

    The body carries the heave of each axle, this its roll, and the roll the hubs with
    their wheels; front hubs turn about their kingpins.
    """
    from sidm.simulation import dimensions as sizes
    from sidm.simulation.linkage import rods as rods_of
    from sidm.simulation.suspension import Suspension

    parts, rods = [_body(sizes.CHASSIS_SIZE)], []
    for number, axle in enumerate(sizes.AXLES):
        joints = Suspension(robot, axle, Physics(strut_motors=strut_motors)).joints
        middle, place = joints.roll_point, joints.pose.place
        sides = [sizes.mirror(axle, side) for side in sizes.SIDES]
        hubs = [place(signs * sizes.REAR_LEFT_HUB) for signs in sides]
        right, left = (_rounded(hub - middle) for hub in hubs)
        tube = {"kind": "tube", "from": right, "to": left, "radius": 0.012}
        heave, carrier = len(parts), len(parts) + 1
        parts += [
            _turning(0, joints.heave_point, joints.heave_axis, 2 * number),
            _turning(
                heave, middle - joints.heave_point, joints.roll_axis, 2 * number + 1
            )
            | {"shapes": [tube]},
        ]
        for side, (signs, pivot) in enumerate(zip(sides, hubs, strict=True)):
            if axle == "front":
                pivot = place(sizes.FRONT_LEFT_KINGPIN * (1, signs[1], 1))
                axis = joints.pose.rotation @ sizes.KINGPIN_AXIS
                axis = axis / np.linalg.norm(sizes.KINGPIN_AXIS)
                hub = _turning(carrier, pivot - middle, axis, 8 + side)
            else:
                hub = {"parent": carrier, "at": _rounded(pivot - middle)}
            tyre = place(signs * sizes.REAR_LEFT_TYRE) - pivot
            size = (sizes.TYRE_RADIUS, sizes.TYRE_WIDTH, float(signs[1]))
            wheel = _wheel(len(parts), tyre, 4 + 2 * number + side, *size)
            parts += [hub, wheel]
        for rod, (axle_end, body_end) in enumerate(rods_of(axle)):
            ends = [
                [carrier, _rounded(place(axle_end) - middle)],
                [0, _rounded(body_end)],
            ]
            rods.append({"kind": "link" if rod < 4 else "strut", "ends": ends})
    return {"parts": parts, "rods": rods}


def heave_curves(robot: Robot, strut_motors: bool = True) -> list[list[float] | None]:
    """Mean strut travel, m, as a polynomial of the heave angle, rad, for each axle.

    Coefficients, the highest power first, for the rear and the front axle; None for an
    axle without heave.
    """
    from sidm.simulation.dimensions import AXLES
    from sidm.simulation.suspension import Suspension

    physics = Physics(strut_motors=strut_motors)
    suspensions = [Suspension(robot, axle, physics) for axle in AXLES]
    return [
        np.round(suspension.joints.heave_travel, 6).tolist()
        if suspension.heave_free
        else None
        for suspension in suspensions
    ]
