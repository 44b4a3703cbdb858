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

import re
from collections.abc import Callable
from typing import Any

import numpy as np

from sidm.drives import yaw_of

#: Reads the columns of a row from one message.
Reader = Callable[[Any], dict[str, float]]

#: Definitions of `ackermann_msgs`, which is not among the standard messages of ROS.
#: Bags of ROS 2 may be without them.
ACKERMANN = {
    "ackermann_msgs/msg/AckermannDrive": "float32 steering_angle\n"
    "float32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\n"
    "float32 jerk\n",
    "ackermann_msgs/msg/AckermannDriveStamped": "std_msgs/Header header\n"
    "ackermann_msgs/AckermannDrive drive\n",
}

#: Unit of each column whose name is not that of a joint.
UNIT_OF_COLUMN = (
    dict.fromkeys(("x", "y", "z"), "m")
    | dict.fromkeys(("qx", "qy", "qz", "qw"), "1")
    | dict.fromkeys(("yaw", "steering_angle"), "rad")
    | dict.fromkeys(("vx", "vy", "vz", "linear", "speed"), "m/s")
    | dict.fromkeys(("linear_y", "linear_z"), "m/s")
    | dict.fromkeys(("wx", "wy", "wz", "yaw_rate", "angular"), "rad/s")
    | dict.fromkeys(("angular_x", "angular_y", "steering_angle_velocity"), "rad/s")
    | dict.fromkeys(("ax", "ay", "az", "acceleration"), "m/s2")
)


def unit_of(column: str) -> str:
    """The unit of a column of a bag; joints are taken for those that turn."""
    if column in UNIT_OF_COLUMN:
        return UNIT_OF_COLUMN[column]
    if re.fullmatch(r"command_\d+", column):
        return "1"
    ends = {"_position": "rad", "_effort": "N m"}
    return next((u for end, u in ends.items() if column.endswith(end)), "rad/s")


def _pose(message: Any) -> dict[str, float]:
    p, q = message.position, message.orientation
    position = {"x": p.x, "y": p.y, "z": p.z}
    quaternion = {"qx": q.x, "qy": q.y, "qz": q.z, "qw": q.w}
    yaw = yaw_of(np.array([*quaternion.values()]))
    return position | quaternion | {"yaw": float(yaw)}


def _rates(message: Any) -> dict[str, float]:
    return {"wx": message.x, "wy": message.y, "wz": message.z, "yaw_rate": message.z}


def _odometry(message: Any) -> dict[str, float]:
    twist = message.twist.twist
    linear = {"vx": twist.linear.x, "vy": twist.linear.y, "vz": twist.linear.z}
    return _pose(message.pose.pose) | linear | _rates(twist.angular)


def _imu(message: Any) -> dict[str, float]:
    a = message.linear_acceleration
    return _rates(message.angular_velocity) | {"ax": a.x, "ay": a.y, "az": a.z}


def _joints(message: Any) -> dict[str, float]:
    names = [re.sub(r"\W", "_", name) for name in message.name]
    columns: dict[str, float] = {}
    for end, values in (
        ("", message.velocity),
        ("_position", message.position),
        ("_effort", message.effort),
    ):
        pairs = zip(names, map(float, values), strict=False)
        columns |= {name + end: value for name, value in pairs}
    return columns


def _twist(message: Any) -> dict[str, float]:
    twist = getattr(message, "twist", message)
    linear, angular = twist.linear, twist.angular
    return {
        "linear": linear.x,
        "linear_y": linear.y,
        "linear_z": linear.z,
        "angular_x": angular.x,
        "angular_y": angular.y,
        "angular": angular.z,
    }


def _ackermann(message: Any) -> dict[str, float]:
    drive = getattr(message, "drive", message)
    names = ("speed", "steering_angle", "acceleration", "steering_angle_velocity")
    return {name: float(getattr(drive, name)) for name in names}


def _array(message: Any) -> dict[str, float]:
    return {f"command_{n}": float(value) for n, value in enumerate(message.data)}


# Type of message -> what reads it, for each kind of topic.
POSES: dict[str, Reader] = {
    "nav_msgs/msg/Odometry": _odometry,
    "geometry_msgs/msg/PoseStamped": lambda m: _pose(m.pose),
}
SENSORS: dict[str, Reader] = {
    "sensor_msgs/msg/Imu": _imu,
    "sensor_msgs/msg/JointState": _joints,
}
COMMANDS: dict[str, Reader] = {
    "geometry_msgs/msg/Twist": _twist,
    "geometry_msgs/msg/TwistStamped": _twist,
    **dict.fromkeys(ACKERMANN, _ackermann),
}
#: An array may hold anything; it is the command where no other topic is one.
ARRAYS: dict[str, Reader] = {
    "std_msgs/msg/Float64MultiArray": _array,
    "std_msgs/msg/Float32MultiArray": _array,
}
