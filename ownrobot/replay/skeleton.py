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
    """Dimensions of a robot by its name or by three lengths.

    Args:
        shape: a name in BOXES, or 'WHEELBASE,TRACK,RADIUS' in m; from these follow the
            sizes of body and tyres.

    Raises:
        ConfigError: `shape` is neither; the message has the nearest name.
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


def _body(size: Iterable[float], at: Iterable[float] = (0, 0, 0)) -> dict[str, Any]:
    """The first part of a skeleton."""
    return {"at": list(at), "shapes": [{"kind": "body", "size": list(size)}]}


def _tyre(radius: float, width: float, side: float) -> list[dict[str, Any]]:
    """Shapes of a wheel; `side` is 1 on the left and -1 on the right."""
    return [{"kind": "tyre", "radius": radius, "width": width, "side": side}]


def box_skeleton(box: Box, on_ground: bool = True) -> Skeleton:
    """Skeleton of a robot without suspension.

    Its joints are the wheels: rear right, rear left, front right, front left. Its frame
    is on the ground between the wheels, or in the middle of the body.
    """
    height = box.clearance + box.size[2] / 2
    parts = [_body(box.size, [0, 0, height] if on_ground else [0, 0, 0])]
    for number, (end, side) in enumerate([(-1, -1), (-1, 1), (1, -1), (1, 1)]):
        hub = [end * box.wheelbase / 2, side * box.track / 2, box.radius - height]
        wheel = {"parent": 0, "at": _rounded(hub), "axis": [0, 1, 0], "joint": number}
        parts.append(wheel | {"shapes": _tyre(box.radius, box.width, side)})
    return {"parts": parts, "rods": []}


def rover_skeleton(robot: Robot, strut_motors: bool = True) -> Skeleton:
    """Skeleton of a robot of the paper, with the joints of `Simulator.joint_angles`."""
    from sidm.simulation.dimensions import AXLES, CHASSIS_SIZE
    from sidm.simulation.suspension import Suspension

    parts = [_body(CHASSIS_SIZE)]
    rods: list[dict[str, Any]] = []
    for number, axle in enumerate(AXLES):
        joints = Suspension(robot, axle, Physics(strut_motors=strut_motors)).joints
        heave = {
            "parent": 0,
            "at": joints.heave_point,
            "axis": joints.heave_axis,
            "joint": 2 * number,
        }
        roll = {
            "parent": len(parts),
            "at": joints.roll_point - joints.heave_point,
            "axis": joints.roll_axis,
            "joint": 2 * number + 1,
            "shapes": [_tube(axle, joints)],
        }
        parts += [heave, roll]
        _add_wheels(parts, axle, number, joints)
        rods += _rods(axle, joints, 2 + 6 * number)
    return {"parts": [_rounded_part(part) for part in parts], "rods": rods}


def _rounded_part(part: dict[str, Any]) -> dict[str, Any]:
    """The part with its point and its axis as rounded lists."""
    vectors = {name: part[name] for name in ("at", "axis") if name in part}
    return part | {name: _rounded(vector) for name, vector in vectors.items()}


def _tube(axle: str, joints: Any) -> dict[str, Any]:
    """Shape of the axle itself, a tube from hub to hub."""
    from sidm.simulation.dimensions import REAR_LEFT_HUB, SIDES, mirror

    hubs = [joints.pose.place(mirror(axle, side) * REAR_LEFT_HUB) for side in SIDES]
    right, left = (_rounded(hub - joints.roll_point) for hub in hubs)
    return {"kind": "tube", "from": right, "to": left, "radius": 0.012}


def _add_wheels(
    parts: list[dict[str, Any]], axle: str, number: int, joints: Any
) -> None:
    """Append hubs and tyres of an axle, which is the last of `parts`.

    The front hubs turn about their kingpins.
    """
    from sidm.simulation import dimensions as sizes

    carrier = len(parts) - 1
    for side_number, side in enumerate(sizes.SIDES):
        signs = sizes.mirror(axle, side)
        pivot = signs * sizes.REAR_LEFT_HUB
        if axle == "front":
            pivot = sizes.FRONT_LEFT_KINGPIN * (1, signs[1], 1)
        pivot = joints.pose.place(pivot)
        tyre = joints.pose.place(signs * sizes.REAR_LEFT_TYRE)
        hub = {"parent": carrier, "at": pivot - joints.roll_point}
        if axle == "front":
            axis = joints.pose.rotation @ sizes.KINGPIN_AXIS
            axis = axis / np.linalg.norm(sizes.KINGPIN_AXIS)
            hub |= {"axis": axis, "joint": 8 + side_number}
        wheel = {
            "parent": len(parts),
            "at": tyre - pivot,
            "axis": [0, 1, 0],
            "shapes": _tyre(sizes.TYRE_RADIUS, sizes.TYRE_WIDTH, float(signs[1])),
            "joint": 4 + 2 * number + side_number,
        }
        parts += [hub, wheel]


def _rods(axle: str, joints: Any, carrier: int) -> list[dict[str, Any]]:
    """Links and struts between the axle, part number `carrier`, and the body."""
    from sidm.simulation.linkage import rods

    found = []
    for number, (axle_end, body_end) in enumerate(rods(axle)):
        ends = [
            [carrier, _rounded(joints.pose.place(axle_end) - joints.roll_point)],
            [0, _rounded(body_end)],
        ]
        found.append({"kind": "link" if number < 4 else "strut", "ends": ends})
    return found


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
