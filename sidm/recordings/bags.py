"""ROS bags, 1 and 2, as tables of drives: poses, velocities and commands by the types of their messages.

=============================================
====================================================================== message                                        columns
=============================================
====================================================================== nav_msgs/Odometry                              x, y, z, qx, qy, qz, qw, yaw; vx, vy, vz, wx, wy, wz and yaw_rate, of
                                               the body
geometry_msgs/PoseStamped                      x, y, z, qx, qy, qz, qw, yaw
sensor_msgs/Imu                                wx, wy, wz, yaw_rate, ax, ay, az
sensor_msgs/JointState                         velocities, by the joints' names
geometry_msgs/Twist, TwistStamped              the command: linear, angular
=============================================
======================================================================

All in SI units. The table has a row for each pose; other sensors are interpolated,
commands hold until the next.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sidm.body import Body
from sidm.config import first_line, hint, unknown_name
from sidm.drives import yaw_of
from sidm.recordings.table import RecordingError, Table

Read = Callable[[Any], dict[str, float]]


def _pose(message: Any) -> dict[str, float]:
    p, q = message.position, message.orientation
    yaw = yaw_of(np.array([q.x, q.y, q.z, q.w]))
    return {
        "x": p.x,
        "y": p.y,
        "z": p.z,
        "qx": q.x,
        "qy": q.y,
        "qz": q.z,
        "qw": q.w,
        "yaw": float(yaw),
    }


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


#: Kind of topic -> its types of messages and what is read from one.
POSES: dict[str, Read] = {
    "nav_msgs/msg/Odometry": _odometry,
    "geometry_msgs/msg/PoseStamped": lambda m: _pose(m.pose),
}
SENSORS: dict[str, Read] = {
    "sensor_msgs/msg/Imu": _imu,
    "sensor_msgs/msg/JointState": lambda m: dict(
        zip(m.name, map(float, m.velocity), strict=False)
    ),
}
COMMANDS: dict[str, Read] = {
    "geometry_msgs/msg/Twist": _twist,
    "geometry_msgs/msg/TwistStamped": _twist,
}


def read_bag(path: Path, body: Body, topics: Sequence[str] = ()) -> Table:
    """The table of a bag that a body names, of all its topics or of some by name.

    Raises:
        RecordingError: a topic is missing or there are several of its kind, the bag is
            cut off, or a column of the body is in none of them; one line.
        ImportError: the library `rosbags` is not installed.
    """
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise ImportError(
            "ROS bags are read with the library rosbags: pip install rosbags"
        ) from None
    try:
        with AnyReader(
            [path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)
        ) as reader:
            bag = _Bag(path, reader, topics)
            poses, commands = bag.series(POSES, "pose"), bag.series(COMMANDS, "command")
            sensors = [
                found
                for kind in SENSORS
                for found in bag.optional({kind: SENSORS[kind]}, kind)
            ]
    except RecordingError:
        raise
    except (
        AnyReaderError,
        OSError,
        ValueError,
        KeyError,
        IndexError,
        RuntimeError,
    ) as error:
        raise RecordingError(
            f"{path}: the bag cannot be read ({first_line(error)}); is it cut off?"
        ) from None
    except Exception as error:  # the readers of the storages raise their own
        raise RecordingError(
            f"{path}: the bag is damaged ({first_line(error)})"
        ) from None
    return _joined(path, body, poses, sensors, commands)


Series = tuple[np.ndarray, dict[str, np.ndarray]]  # times, s, and columns


class _Bag:
    """An open bag, of which all topics are read or some by name."""

    def __init__(self, path: Path, reader: Any, topics: Sequence[str]):
        self.path, self.reader = path, reader
        known = {one.topic for one in reader.connections}
        for name in topics:
            if name not in known:
                raise RecordingError(
                    f"{path}: {unknown_name(name, sorted(known), 'the topics')}"
                )
        self.connections = [
            one for one in reader.connections if not topics or one.topic in topics
        ]

    def series(self, kinds: dict[str, Read], what: str) -> Series:
        """The only topic of some kinds."""
        found = list(self.optional(kinds, what))
        if not found:
            there = (
                ", ".join(
                    sorted({f"{one.topic} ({one.msgtype})" for one in self.connections})
                )
                or "none"
            )
            raise RecordingError(
                f"{self.path}: no topic with a {what} ({', '.join(kinds)}); there are {there}"
            )
        return found[0]

    def optional(self, kinds: dict[str, Read], what: str) -> Iterator[Series]:
        """The topic of some kinds, if there is one."""
        mine = [one for one in self.connections if one.msgtype in kinds]
        names = sorted({one.topic for one in mine})
        if len(names) > 1:
            which = f"{len(names)} topics with a {what}, {', '.join(names)}"
            raise RecordingError(
                f"{self.path}: {which}; name those that are meant with --topics"
            )
        if not names:
            return
        times, rows = [], []
        for connection, time, raw in self.reader.messages(connections=mine):
            rows.append(
                kinds[connection.msgtype](
                    self.reader.deserialize(raw, connection.msgtype)
                )
            )
            times.append(time * 1e-9)
        if len(rows) < 2:
            raise RecordingError(
                f"{self.path}: {len(rows)} messages on {names[0]}, too few for a drive"
            )
        yield (
            np.array(times),
            {
                name: np.array([row.get(name, np.nan) for row in rows])
                for name in rows[0]
            },
        )


def _joined(
    path: Path, body: Body, poses: Series, sensors: list[Series], commands: Series
) -> Table:
    """One table at the times of the poses that lie within all other topics' times."""
    others = [*sensors, commands]
    first, last = max(one[0][0] for one in others), min(one[0][-1] for one in others)
    time = poses[0]
    inside = (time >= first) & (time <= last)
    if inside.sum() < 2:
        raise RecordingError(f"{path}: its topics have no time in common")
    time = time[inside]
    columns = {name: values[inside] for name, values in poses[1].items()}
    for times, values in sensors:
        columns |= {name: np.interp(time, times, one) for name, one in values.items()}
    held = np.searchsorted(commands[0], time, side="right") - 1
    columns |= {name: one[held] for name, one in commands[1].items()}
    wanted = [name for name, _ in (*body.state, *body.actions)]
    for name in wanted:
        if name not in columns:
            what = f"column '{name}' of body '{body.name}'"
            raise RecordingError(
                f"{path}: {what} is in no topic; {hint(name, columns)}"
            )
    return Table(
        str(path), {name: columns[name] for name in wanted} | {"time": time}, {}, None
    )
