"""Read drives from ROS bags, version 1 or 2, as tables.

The type of its messages says what a topic holds:

==========================  ==========================================================
message                     columns
==========================  ==========================================================
nav_msgs/Odometry           x, y, z, qx, qy, qz, qw, yaw; in the body frame vx, vy,
                            vz, wx, wy, wz, yaw_rate
geometry_msgs/PoseStamped   x, y, z, qx, qy, qz, qw, yaw
sensor_msgs/Imu             wx, wy, wz, yaw_rate, ax, ay, az
sensor_msgs/JointState      velocities, named after the joints
geometry_msgs/Twist         the command: linear, angular
geometry_msgs/TwistStamped  the command: linear, angular
==========================  ==========================================================

All numbers are in SI units. The table has a row for each pose; other sensors are
interpolated, and a command holds until the next one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sidm.body import Body
from sidm.config import first_line, hint, unknown_name
from sidm.drives import yaw_of
from sidm.recordings.table import RecordingError, Table

#: Reads the columns of a row from one message.
Reader = Callable[[Any], dict[str, float]]
Series = tuple[np.ndarray, dict[str, np.ndarray]]  # times, s, and columns


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


def _twist(message: Any) -> dict[str, float]:
    twist = getattr(message, "twist", message)
    return {"linear": twist.linear.x, "angular": twist.angular.z}


# Type of message -> what reads it, for each kind of topic.
POSES: dict[str, Reader] = {
    "nav_msgs/msg/Odometry": _odometry,
    "geometry_msgs/msg/PoseStamped": lambda m: _pose(m.pose),
}
SENSORS: dict[str, Reader] = {
    "sensor_msgs/msg/Imu": _imu,
    "sensor_msgs/msg/JointState": lambda m: dict(
        zip(m.name, map(float, m.velocity), strict=False)
    ),
}
COMMANDS: dict[str, Reader] = {
    "geometry_msgs/msg/Twist": _twist,
    "geometry_msgs/msg/TwistStamped": _twist,
}


def read_bag(path: Path, body: Body, topics: Sequence[str] = ()) -> Table:
    """Read the columns of a body from a bag.

    Args:
        path: of the bag.
        body: whose columns are read.
        topics: names of the topics to read; all unless given.

    Raises:
        RecordingError: a topic is missing, or a kind of topic occurs more than once, or
            the bag is cut off, or no topic has a column of the body; the message is one
            line.
        ImportError: the library `rosbags` is not installed.
    """
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise ImportError(
            "ROS bags are read with the library rosbags: pip install rosbags"
        ) from None
    unreadable = OSError, ValueError, KeyError, IndexError, RuntimeError, AnyReaderError
    types = get_typestore(Stores.ROS2_HUMBLE)
    try:
        with AnyReader([path], default_typestore=types) as reader:
            bag = _Bag(path, reader, topics)
            poses, commands = bag.series(POSES, "pose"), bag.series(COMMANDS, "command")
            sensors = [
                bag.optional({message: read}, message)
                for message, read in SENSORS.items()
            ]
    except RecordingError:
        raise
    except unreadable as error:
        raise RecordingError(
            f"{path}: the bag cannot be read ({first_line(error)}); is it cut off?"
        ) from None
    except Exception as error:  # each storage format has errors of its own
        raise RecordingError(
            f"{path}: the bag is damaged ({first_line(error)})"
        ) from None
    return _joined(path, body, poses, [s for s in sensors if s is not None], commands)


class _Bag:
    """An open bag, of which all topics are read or only those named."""

    def __init__(self, path: Path, reader: Any, topics: Sequence[str]):
        self.path, self.reader = path, reader
        known = {connection.topic for connection in reader.connections}
        for name in topics:
            if name not in known:
                error = unknown_name(name, sorted(known), "the topics")
                raise RecordingError(f"{path}: {error}")
        self.connections = [
            connection
            for connection in reader.connections
            if not topics or connection.topic in topics
        ]

    def series(self, readers: dict[str, Reader], kind: str) -> Series:
        """Read the one topic with messages of some types; `kind` names it in errors."""
        series = self.optional(readers, kind)
        if series is None:
            present = {f"{c.topic} ({c.msgtype})" for c in self.connections}
            raise RecordingError(
                f"{self.path}: no topic with a {kind} ({', '.join(readers)}); "
                f"there are {', '.join(sorted(present)) or 'none'}"
            )
        return series

    def optional(self, readers: dict[str, Reader], kind: str) -> Series | None:
        """Read the topic with messages of some types; None if there is none."""
        connections = [c for c in self.connections if c.msgtype in readers]
        names = sorted({connection.topic for connection in connections})
        if len(names) > 1:
            raise RecordingError(
                f"{self.path}: {len(names)} topics with a {kind}, {', '.join(names)}; "
                "name those that are meant with --topics"
            )
        if not names:
            return None
        times, rows = [], []
        for connection, time, raw in self.reader.messages(connections=connections):
            message = self.reader.deserialize(raw, connection.msgtype)
            rows.append(readers[connection.msgtype](message))
            times.append(time * 1e-9)
        if len(rows) < 2:
            raise RecordingError(
                f"{self.path}: {len(rows)} messages on {names[0]}, too few for a drive"
            )
        columns = {
            name: np.array([row.get(name, np.nan) for row in rows]) for name in rows[0]
        }
        return np.array(times), columns


def _joined(
    path: Path, body: Body, poses: Series, sensors: list[Series], commands: Series
) -> Table:
    """One table at the times of the poses that lie within the times of all topics."""
    others = [*sensors, commands]
    first, last = max(t[0] for t, _ in others), min(t[-1] for t, _ in others)
    time = poses[0]
    inside = (time >= first) & (time <= last)
    if inside.sum() < 2:
        raise RecordingError(f"{path}: its topics have no time in common")
    time = time[inside]
    columns = {name: values[inside] for name, values in poses[1].items()}
    for times, series in sensors:
        columns |= {n: np.interp(time, times, values) for n, values in series.items()}
    held = np.searchsorted(commands[0], time, side="right") - 1  # the last command
    columns |= {name: values[held] for name, values in commands[1].items()}
    wanted = [name for name, _ in (*body.state, *body.actions)]
    for name in wanted:
        if name not in columns:
            raise RecordingError(
                f"{path}: column '{name}' of body '{body.name}' is in no topic; "
                f"{hint(name, columns)}"
            )
    numbers = {name: columns[name] for name in wanted} | {"time": time}
    return Table(str(path), numbers, {}, None)
