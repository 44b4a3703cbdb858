"""The topics of a ROS bag, version 1 or 2: their messages' numbers, on one clock.

The module `messages` says which columns a message gives, `clocks` when it counts.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ownrobot.recordings.clocks import Messages, on_one_clock
from ownrobot.recordings.messages import (
    ACKERMANN,
    ARRAYS,
    COMMANDS,
    IMU,
    JOINTS,
    POSES,
    columns_of,
)
from ownrobot.recordings.table import RecordingError
from sidm.config import first_line, unknown_name

SPLIT = 1.0  # s between two bags of one recording, at most


class Samples(NamedTuple):
    """The numbers of one column, on the bag's clock."""

    times: np.ndarray  # (N,) s, rising
    values: np.ndarray  # (N,)


class Topics(NamedTuple):
    """The topics of a bag that are read, over a time in which its clock rises."""

    pose: dict[str, Samples]
    sensors: dict[str, Samples]
    command: dict[str, Samples]


def read_topics(
    path: Path, topics: Sequence[str] = ()
) -> tuple[list[Topics], list[str], str]:
    """Read the pose, the sensors and the command of a bag, on one clock.

    The topics are in several parts where the clock of the poses goes back. With them
    come lines about clocks and messages that are left out, and the bag's session: the
    first of the bags that a recorder made of one recording.
    """
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
            present = {
                c.msgtype for c in reader.connections if c.topic in topics or not topics
            }
            commands = [*COMMANDS] if present & {*COMMANDS} else [*COMMANDS, *ARRAYS]
            read = [
                _messages(reader, topics, POSES, "pose"),
                _messages(reader, topics, commands, "command"),
            ]
            for kind in (*IMU, *JOINTS):
                if kind in present:
                    read.append(_messages(reader, topics, [kind], kind))
            session = _first_of_split(path, reader)
    except RecordingError:
        raise
    except unreadable as error:
        raise RecordingError(
            f"the bag cannot be read ({first_line(error)}); is it cut off?"
        ) from None
    except Exception as error:  # each storage format has errors of its own
        raise RecordingError(
            f"the bag is damaged ({first_line(error)}); copy it again, or "
            "mend it with 'rosbag reindex' or 'ros2 bag reindex'"
        ) from None
    return *_parts(read), str(session)


def _messages(
    reader: Any, topics: Sequence[str], kinds: Collection[str], what: str
) -> Messages:
    """Read the one topic with messages of some types; `what` names it in errors."""
    usable = [c for c in reader.connections if not topics or c.topic in topics]
    connections = [c for c in usable if c.msgtype in kinds]
    names = sorted({connection.topic for connection in connections})
    if not names:
        known = sorted({connection.topic for connection in reader.connections})
        for name in topics:  # names of another robot's bag may be among them
            if name not in known:
                raise RecordingError(unknown_name(name, known, kind="topic"))
        there = sorted({f"{c.topic} ({c.msgtype})" for c in usable})
        raise RecordingError(
            f"no topic with a {what} ({', '.join(kinds)}); "
            f"there are {', '.join(there) or 'none'}"
        )
    if len(names) > 1:
        raise RecordingError(
            f"{len(names)} topics with a {what}, {', '.join(names)}; "
            "name those that are meant with --topics"
        )
    received: list[float] = []
    stamps: list[float] = []
    found: dict[str, tuple[list[int], list[float]]] = {}
    for connection, time, raw in reader.messages(connections=connections):
        message = reader.deserialize(raw, connection.msgtype)
        # a message of a topic may be without some columns, as those of joints
        for name, value in columns_of(message, connection.msgtype).items():
            rows, values = found.setdefault(name, ([], []))
            rows.append(len(received))
            values.append(value)
        received.append(time * 1e-9)
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        stamps.append(stamp.sec + stamp.nanosec * 1e-9 if stamp else 0.0)
    if len(received) < 2:
        raise RecordingError(
            f"{len(received)} messages on {names[0]}, too few for a drive"
        )
    columns = {name: (np.array(r), np.array(v)) for name, (r, v) in found.items()}
    stamped = np.array(stamps) if min(stamps) > 0 else None
    return Messages(names[0], np.array(received), stamped, columns)


def _first_of_split(path: Path, reader: Any) -> Path:
    """The first of the bags NAME_0, NAME_1, ... that follow on each other."""
    found = re.fullmatch(r"(.+_)(\d+)((?:\.\w+)?)", path.name)
    if not found or found[2] == "0":
        return path
    before = path.with_name(f"{found[1]}{int(found[2]) - 1}{found[3]}")
    if not before.exists():
        return path
    types = reader.default_typestore
    try:
        with type(reader)([before], default_typestore=types) as earlier:
            gap = (reader.start_time - earlier.end_time) * 1e-9
            return _first_of_split(before, earlier) if abs(gap) <= SPLIT else path
    except Exception:  # it is damaged, which is told where it is read itself
        return path


def _parts(read: Sequence[Messages]) -> tuple[list[Topics], list[str]]:
    """Pose, command and sensors on one clock, cut where that of the poses goes back."""
    clocks, notes = on_one_clock(read)
    same = np.r_[False, np.diff(clocks[0]) == 0]
    if same.any():
        what = "1 pose has" if same.sum() == 1 else f"{same.sum()} poses have"
        notes.append(f"{what} the time of the pose before, and is left out")
    clocks[0] = np.where(same, np.nan, clocks[0])
    kept = np.flatnonzero(np.isfinite(clocks[0]))
    back = kept[1:][np.diff(clocks[0][kept]) < 0]
    limits = [-np.inf, *read[0].received[back], np.inf]
    parts = []
    for start, end in zip(limits, limits[1:], strict=False):
        pose, command, *others = (
            _series(one, clock, (one.received >= start) & (one.received < end))
            for one, clock in zip(read, clocks, strict=True)
        )
        sensors = {name: found for one in others for name, found in one.items()}
        if pose and command:
            parts.append(Topics(pose, sensors, command))
    if not parts:
        raise RecordingError("its topics have no time in common; record them together")
    return parts, notes


def _series(one: Messages, clock: np.ndarray, kept: np.ndarray) -> dict[str, Samples]:
    """Columns of messages that are `kept`, at rising times; the last of each time."""
    times, series = np.where(kept, clock, np.nan), {}
    for name, (rows, values) in one.columns.items():
        at = times[rows]
        there = np.flatnonzero(np.isfinite(at))
        order = there[np.argsort(at[there], kind="stable")]
        last = np.r_[np.diff(at[order]) > 0, True] if len(order) else order
        if last.sum() > 1:
            series[name] = Samples(at[order][last], values[order][last])
    return series
