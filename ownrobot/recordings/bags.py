"""Read drives from ROS bags, version 1 or 2, as tables.

The module `messages` says which columns a message gives. The table has a row for each
pose. Other sensors are interpolated, but not across a pause of theirs: the rows in it
are left out. A command holds until the next one.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ownrobot.recordings.checks import GAP
from ownrobot.recordings.messages import (
    ACKERMANN,
    ARRAYS,
    COMMANDS,
    POSES,
    SENSORS,
    Reader,
)
from ownrobot.recordings.table import RecordingError, Table
from sidm.body import Body
from sidm.config import first_line, hint, unknown_name


class Samples(NamedTuple):
    """The numbers of one column, as they came."""

    times: np.ndarray  # (N,) s
    values: np.ndarray  # (N,)


Series = dict[str, Samples]  # the columns of one topic


class Topics(NamedTuple):
    """The topics of a bag that are read."""

    pose: Series
    sensors: Series
    command: Series


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
    wanted = [name for name, _ in (*body.state, *body.actions)]
    columns = bag_columns(path, read_topics(path, topics), wanted, body.name)
    return Table(str(path), columns, {}, None)


def read_topics(path: Path, topics: Sequence[str] = ()) -> Topics:
    """Read the pose, the sensors and the command of a bag; errors as in `read_bag`."""
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError:
        raise ImportError(
            "ROS bags are read with the library rosbags: pip install rosbags"
        ) from None
    unreadable = OSError, ValueError, KeyError, IndexError, RuntimeError, AnyReaderError
    types = get_typestore(Stores.ROS2_HUMBLE)
    for name, definition in ACKERMANN.items():
        types.register(get_types_from_msg(definition, name))
    try:
        with AnyReader([path], default_typestore=types) as reader:
            bag = _Bag(path, reader, topics)
            pose = bag.series(POSES, "pose")
            arrays = {} if bag.has(COMMANDS) else ARRAYS
            command = bag.series(COMMANDS | arrays, "command")
            sensors: Series = {}
            for message, read in SENSORS.items():
                sensors |= bag.optional({message: read}, message) or {}
    except RecordingError:
        raise
    except unreadable as error:
        raise RecordingError(
            f"{path}: the bag cannot be read ({first_line(error)}); is it cut off?"
        ) from None
    except Exception as error:  # each storage format has errors of its own
        raise RecordingError(
            f"{path}: the bag is damaged ({first_line(error)}); copy it again, or "
            "mend it with 'rosbag reindex' or 'ros2 bag reindex'"
        ) from None
    return Topics(pose, sensors, command)


class _Bag:
    """An open bag, of which all topics are read or only those named."""

    def __init__(self, path: Path, reader: Any, topics: Sequence[str]):
        self.path, self.reader = path, reader
        known = {connection.topic for connection in reader.connections}
        for name in topics:
            if name not in known:
                error = unknown_name(name, sorted(known), kind="topic")
                raise RecordingError(f"{path}: {error}")
        self.connections = [
            connection
            for connection in reader.connections
            if not topics or connection.topic in topics
        ]

    def has(self, readers: dict[str, Reader]) -> bool:
        """Whether a topic has messages of some types."""
        return any(connection.msgtype in readers for connection in self.connections)

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
        count, found = 0, dict[str, list[tuple[float, float]]]()
        for connection, time, raw in self.reader.messages(connections=connections):
            message = self.reader.deserialize(raw, connection.msgtype)
            # a message of a topic may be without some columns, as those of joints
            for name, value in readers[connection.msgtype](message).items():
                found.setdefault(name, []).append((time * 1e-9, value))
            count += 1
        if count < 2:
            raise RecordingError(
                f"{self.path}: {count} messages on {names[0]}, too few for a drive"
            )
        return {
            name: Samples(*np.array(samples).T)
            for name, samples in found.items()
            if len(samples) > 1
        }


def bag_columns(
    path: Path, topics: Topics, wanted: Sequence[str], body: str
) -> dict[str, np.ndarray]:
    """Columns at the times of the poses that lie within the times of all of them.

    Args:
        path: of the bag, for messages.
        topics: of the bag.
        wanted: names of the columns.
        body: name of the body, for messages.

    Returns:
        Name of each wanted column, and `time` in s -> numbers (R,).
    """
    known = topics.pose | topics.sensors | topics.command
    for name in wanted:
        if name not in known:
            raise RecordingError(
                f"{path}: column '{name}' of body '{body}' is in no topic; "
                f"{hint(name, known)}"
            )
    # a sensor of the same name as a part of the pose's message comes first
    sensors = {n: topics.sensors[n] for n in wanted if n in topics.sensors}
    commands = {n: topics.command[n] for n in wanted if n in topics.command}
    poses = next(iter(topics.pose.values()))
    time = _times_in_common(path, poses.times, sensors, commands or topics.command)
    columns = {}
    for name in wanted:
        if name in commands:
            times, values = commands[name]
            held = np.searchsorted(times, time, side="right") - 1  # the last command
            columns[name] = values[held]
        elif name in sensors:
            columns[name] = np.interp(time, *sensors[name])
        else:
            columns[name] = topics.pose[name].values[np.isin(poses.times, time)]
    return columns | {"time": time}


def _times_in_common(
    path: Path, poses: np.ndarray, sensors: Series, commands: Series
) -> np.ndarray:
    """Times of poses, s, at which sensors and commands are known."""
    others = [samples.times for samples in (*sensors.values(), *commands.values())]
    first, last = max(t[0] for t in others), min(t[-1] for t in others)
    inside = (poses >= first) & (poses <= last)
    spacing = np.median(np.diff(poses))
    for times, _ in sensors.values():
        steps = np.diff(times)
        pause = steps > GAP * max(spacing, np.median(steps))
        after = np.clip(np.searchsorted(times, poses, side="right"), 1, len(steps))
        inside &= ~pause[after - 1] | np.isin(poses, times)
    if inside.sum() < 2:
        raise RecordingError(
            f"{path}: its topics have no time in common; record them together"
        )
    return poses[inside]
