"""Columns that messages of ROS bags give, by the type of the message.

==============================  ======================================================
message                         columns
==============================  ======================================================
nav_msgs/Odometry               x, y, z, qx, qy, qz, qw, yaw; in the body frame vx,
                                vy, vz, wx, wy, wz, yaw_rate
geometry_msgs/PoseStamped       x, y, z, qx, qy, qz, qw, yaw
sensor_msgs/Imu                 wx, wy, wz, yaw_rate, ax, ay, az
sensor_msgs/JointState          velocities, named after the joints; positions and
                                efforts as `<joint>_position` and `<joint>_effort`
geometry_msgs/Twist             the command: linear (forward), linear_y, linear_z,
geometry_msgs/TwistStamped      angular (about z), angular_x, angular_y
ackermann_msgs/AckermannDrive   the command: speed, steering_angle, acceleration,
ackermann_msgs/                 steering_angle_velocity
AckermannDriveStamped
std_msgs/Float64MultiArray      the command: command_0, command_1, ...
std_msgs/Float32MultiArray      the command: command_0, command_1, ...
==============================  ======================================================

All numbers are in SI units. In the name of a joint each character other than letters,
digits and _ becomes _.
"""

from __future__ import annotations

import operator
import re
from typing import Any

import numpy as np

from sidm.drives import yaw_of

#: Definitions of `ackermann_msgs`, which is not among the standard messages of ROS.
#: Bags of ROS 2 may be without them.
ACKERMANN = {
    "ackermann_msgs/msg/AckermannDrive": "float32 steering_angle\n"
    "float32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\n"
    "float32 jerk\n",
    "ackermann_msgs/msg/AckermannDriveStamped": "std_msgs/Header header\n"
    "ackermann_msgs/AckermannDrive drive\n",
}

# Types of messages, for each kind of topic -> paths of their parts with numbers.
POSES = {
    "nav_msgs/msg/Odometry": (
        *("pose/pose/position", "pose/pose/orientation"),
        *("twist/twist/linear", "twist/twist/angular"),
    ),
    "geometry_msgs/msg/PoseStamped": ("pose/position", "pose/orientation"),
}
IMU = {"sensor_msgs/msg/Imu": ("angular_velocity", "linear_acceleration")}
JOINTS: dict[str, tuple[str, ...]] = {"sensor_msgs/msg/JointState": ()}
COMMANDS = {
    "geometry_msgs/msg/Twist": ("linear", "angular"),
    "geometry_msgs/msg/TwistStamped": ("twist/linear", "twist/angular"),
    "ackermann_msgs/msg/AckermannDrive": ("",),
    "ackermann_msgs/msg/AckermannDriveStamped": ("drive",),
}
#: An array may hold anything; it is the command where no other topic is one.
ARRAYS: dict[str, tuple[str, ...]] = {
    "std_msgs/msg/Float64MultiArray": (),
    "std_msgs/msg/Float32MultiArray": (),
}
PARTS_OF_TYPE = POSES | IMU | COMMANDS
QUATERNION = ("qx", "qy", "qz", "qw")

#: The end of a part's path -> its numbers -> their columns; the first that fits counts.
PARTS = {
    "position": {name: name for name in "xyz"},
    "orientation": {"x": "qx", "y": "qy", "z": "qz", "w": "qw", "yaw": "yaw"},
    "angular_velocity": {"x": "wx", "y": "wy", "z": "yaw_rate"},
    "linear_acceleration": {"x": "ax", "y": "ay", "z": "az"},
    "twist/twist/linear": {"x": "vx", "y": "vy", "z": "vz"},
    "twist/twist/angular": {"x": "wx", "y": "wy", "z": "yaw_rate"},
    "linear": {"x": "linear", "y": "linear_y", "z": "linear_z"},
    "angular": {"x": "angular_x", "y": "angular_y", "z": "angular"},
}
DRIVE = ("speed", "steering_angle", "acceleration", "steering_angle_velocity")

#: Unit -> the columns that have it; those of joints are in rad/s.
UNITS = {
    "m": "x y z",
    "1": "qx qy qz qw",
    "rad": "yaw steering_angle",
    "m/s": "vx vy vz linear linear_y linear_z speed",
    "m/s2": "ax ay az acceleration",
}


def columns_of_part(path: str) -> dict[str, str]:
    """Numbers of a part of a message -> their columns; a path is as 'pose/position'."""
    ends = (end for end in PARTS if f"/{path}".endswith(f"/{end}"))
    return PARTS.get(next(ends, ""), {})


def unit_of(column: str) -> str:
    """The unit of a column of a bag; joints are taken for those that turn."""
    for unit, columns in UNITS.items():
        if column in columns.split():
            return unit
    if re.fullmatch(r"command_\d+", column):
        return "1"
    ends = {"_position": "rad", "_effort": "N m"}
    return next((u for end, u in ends.items() if column.endswith(end)), "rad/s")


def plain_name(name: str) -> str:
    """The name of a joint or a topic as that of a column."""
    return re.sub(r"\W", "_", name)


def columns_of(message: Any, kind: str) -> dict[str, float]:
    """The numbers of a message of this type, by the names of their columns."""
    if kind in ARRAYS:
        return {f"command_{n}": float(value) for n, value in enumerate(message.data)}
    columns: dict[str, float] = {}
    if kind in JOINTS:
        names = [plain_name(name) for name in message.name]
        for end, values in (
            ("", message.velocity),
            ("_position", message.position),
            ("_effort", message.effort),
        ):
            pairs = zip(names, map(float, values), strict=False)
            columns |= {name + end: value for name, value in pairs}
        return columns
    for path in PARTS_OF_TYPE[kind]:
        part = operator.attrgetter(path.replace("/", "."))(message) if path else message
        if kind in ACKERMANN:
            return {name: float(getattr(part, name)) for name in DRIVE}
        for axis, name in columns_of_part(path).items():
            if name == "yaw":
                quaternion = np.array([columns[name] for name in QUATERNION])
                columns["yaw"] = float(yaw_of(quaternion))
                continue
            if name == "yaw_rate":
                columns["wz"] = part.z
            columns[name] = getattr(part, axis)
    return columns
