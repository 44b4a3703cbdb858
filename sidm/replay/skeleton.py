"""What a drawn robot is made of: parts that turn on one another, with shapes on them, and rods between them.

A skeleton is a mapping of JSON types, which static/robot.js draws. Each of its `parts`
stands `at` a point of its parent's frame, m (the first is the body's own, the parents
of the others come before them); where it has a `joint` it turns about `axis` by that
column of a track's joints, rad. `rods` end at points of two parts: links, and struts
with their springs. Body frame: x ahead, y left, z up.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from sidm.config import ConfigError, unknown_name
from sidm.systems import Physics, Robot

Skeleton = Mapping[str, Any]


class Box(NamedTuple):
    """A body on four wheels without suspension, as its maker gives it; all in m."""

    size: tuple[float, float, float]  # of the body: long, wide, high
    wheelbase: float
    track: float
    radius: float  # of the wheels
    width: float  # of a tyre
    clearance: float  # of the body's lower side above the ground


#: Published dimensions of Clearpath's robots, rounded to cm.
BOXES = {
    "warthog": Box((1.30, 0.84, 0.42), 0.91, 1.13, 0.30, 0.24, 0.26),
    "husky": Box((0.90, 0.44, 0.24), 0.51, 0.57, 0.17, 0.11, 0.13),
}


def find_box(words: str) -> Box:
    """The robot of that name in BOXES, or 'WHEELBASE,TRACK,RADIUS' in m; ConfigError for others."""
    if words in BOXES:
        return BOXES[words]
    try:
        base, track, radius = map(float, words.split(","))
    except ValueError:
        raise unknown_name(
            words, BOXES, "the shapes (or WHEELBASE,TRACK,RADIUS in m)"
        ) from None
    if not all(0 < length < math.inf for length in (base, track, radius)):
        raise ConfigError(
            f"a wheelbase, a track and a radius are positive lengths in m, not '{words}'"
        )
    return Box(
        (1.3 * base, 0.6 * track, 1.2 * radius),
        base,
        track,
        radius,
        0.25 * track,
        0.9 * radius,
    )


def _points(values: Any) -> Any:
    return np.round(values, 4).tolist()


def _tyre(radius: float, width: float, side: float) -> list[dict[str, Any]]:
    return [{"kind": "tyre", "radius": radius, "width": width, "side": side}]


def box_skeleton(box: Box, on_ground: bool = True) -> Skeleton:
    """A body without suspension; its joints are the wheels, rear right, rear left, front right, front left.

    Args:
        box: its dimensions.
        on_ground: whether its frame stands on the ground between the wheels, or in the
            body's middle.
    """
    middle = [0, 0, box.clearance + box.size[2] / 2]
    at = middle if on_ground else [0, 0, 0]
    parts: list[dict[str, Any]] = [
        {"at": at, "shapes": [{"kind": "body", "size": list(box.size)}]}
    ]
    for number, (along, side) in enumerate([(-1, -1), (-1, 1), (1, -1), (1, 1)]):
        place = [
            along * box.wheelbase / 2,
            side * box.track / 2,
            box.radius - middle[2],
        ]
        shapes = _tyre(box.radius, box.width, side)
        parts.append(
            {
                "parent": 0,
                "at": _points(place),
                "axis": [0, 1, 0],
                "joint": number,
                "shapes": shapes,
            }
        )
    return {"parts": parts, "rods": []}


def rover_skeleton(robot: Robot, strut_motors: bool = True) -> Skeleton:
    """A robot of the paper, on the axles that the simulation hangs it on; its joints are `Simulator.joint_angles`."""
    from sidm.simulation.dimensions import AXLES, CHASSIS_SIZE
    from sidm.simulation.suspension import Suspension

    parts: list[dict[str, Any]] = [
        {"at": [0, 0, 0], "shapes": [{"kind": "body", "size": list(CHASSIS_SIZE)}]}
    ]
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
    return {"parts": [_plain(part) for part in parts], "rods": rods}


def _plain(part: dict[str, Any]) -> dict[str, Any]:
    return part | {name: _points(part[name]) for name in ("at", "axis") if name in part}


def _tube(axle: str, joints: Any) -> dict[str, Any]:
    """The axle itself, from hub to hub."""
    from sidm.simulation.dimensions import REAR_LEFT_HUB, SIDES, mirror

    ends = [
        _points(
            joints.pose.place(mirror(axle, side) * REAR_LEFT_HUB) - joints.roll_point
        )
        for side in SIDES
    ]
    return {"kind": "tube", "from": ends[0], "to": ends[1], "radius": 0.012}


def _add_wheels(
    parts: list[dict[str, Any]], axle: str, number: int, joints: Any
) -> None:
    """Hubs and tyres of an axle, the last of `parts`; the front hubs turn about their kingpins."""
    from sidm.simulation import dimensions as robot

    carrier = len(parts) - 1
    for side_number, side in enumerate(robot.SIDES):
        signs = robot.mirror(axle, side)
        pivot = (
            robot.FRONT_LEFT_KINGPIN * (1, signs[1], 1)
            if axle == "front"
            else signs * robot.REAR_LEFT_HUB
        )
        pivot, tyre = (
            joints.pose.place(pivot),
            joints.pose.place(signs * robot.REAR_LEFT_TYRE),
        )
        hub = {"parent": carrier, "at": pivot - joints.roll_point}
        if axle == "front":
            axis = (
                joints.pose.rotation
                @ robot.KINGPIN_AXIS
                / np.linalg.norm(robot.KINGPIN_AXIS)
            )
            hub |= {"axis": axis, "joint": 8 + side_number}
        shapes = _tyre(robot.TYRE_RADIUS, robot.TYRE_WIDTH, float(signs[1]))
        wheel = {
            "parent": len(parts),
            "at": tyre - pivot,
            "axis": [0, 1, 0],
            "shapes": shapes,
        }
        parts += [hub, wheel | {"joint": 4 + 2 * number + side_number}]


def _rods(axle: str, joints: Any, carrier: int) -> list[dict[str, Any]]:
    """Links and struts from the axle, part number `carrier`, to the body."""
    from sidm.simulation.linkage import rods

    found = []
    for number, (own, sprung) in enumerate(rods(axle)):
        ends = [
            [carrier, _points(joints.pose.place(own) - joints.roll_point)],
            [0, _points(sprung)],
        ]
        found.append({"kind": "link" if number < 4 else "strut", "ends": ends})
    return found


def heave_curves(robot: Robot, strut_motors: bool = True) -> list[list[float] | None]:
    """Of rear and front axle: mean strut travel, m, as a polynomial of the heave's angle; None without heave."""
    from sidm.simulation.dimensions import AXLES
    from sidm.simulation.suspension import Suspension

    suspensions = [
        Suspension(robot, axle, Physics(strut_motors=strut_motors)) for axle in AXLES
    ]
    return [
        np.round(one.joints.heave_travel, 6).tolist() if one.heave_free else None
        for one in suspensions
    ]
