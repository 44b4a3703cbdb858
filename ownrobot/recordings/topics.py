"""The topics of a ROS bag, version 1 or 2: their messages' numbers, on one clock.

The module `messages` says which columns a message gives, `clocks` when it counts.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ownrobot.recordings.clocks import Messages, on_one_clock
from ownrobot.recordings.messages import (
    ACKERMANN,
    ARRAYS,
    COMMANDS,
    POSES,
    SENSORS,
    Reader,
)
from ownrobot.recordings.table import RecordingError
from sidm.config import first_line, unknown_name

SPLIT = 1.0  # s between two bags of one recording, at most


class Samples(NamedTuple):
    """The numbers of one column, on the bag's clock."""

    times: np.ndarray  # (N,) s, rising
    values: np.ndarray  # (N,)


Series = dict[str, Samples]  # the columns of one kind of topic


class Topics(NamedTuple):
    """The topics of a bag that are read, over a time in which its clock rises."""

    pose: Series
    sensors: Series
    command: Series


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
            bag = _Bag(path, reader, topics)
            pose = bag.messages(POSES, "pose")
            arrays = {} if bag.has(COMMANDS) else ARRAYS
            command = bag.messages(COMMANDS | arrays, "command")
            sensors = [
                found
                for message, read in SENSORS.items()
                if (found := bag.optional({message: read}, message)) is not None
            ]
            session = _first_of_split(path, reader)
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
    return *_parts(path, [pose, command, *sensors]), str(session)


def _first_of_split(path: Path, reader: Any) -> Path:
    """The first of the bags NAME_0, NAME_1, ... of one recording that ends in a bag.

    Each of them begins where the one before ends.
    """
    found = re.fullmatch(r"(.+_)(\d+)((?:\.\w+)?)", path.name)
    if not found or found[2] == "0":
        return path
    before = path.with_name(f"{found[1]}{int(found[2]) - 1}{found[3]}")
    if not before.exists():
        return path
    try:
        with type(reader)(
            [before], default_typestore=reader.default_typestore
        ) as earlier:
            gap = (reader.start_time - earlier.end_time) * 1e-9
            return _first_of_split(before, earlier) if abs(gap) <= SPLIT else path
    except Exception:  # it is damaged, which is told where it is read itself
        return path


def _parts(path: Path, read: Sequence[Messages]) -> tuple[list[Topics], list[str]]:
    """Pose, command and sensors on one clock, cut where that of the poses goes back."""
    clocks, notes = on_one_clock(read)
    notes = [f"{path}: {note}" for note in notes]
    times = clocks[0]
    same = _repeats(read[0], times)
    if same.any():
        what = "1 pose has" if same.sum() == 1 else f"{same.sum()} poses have"
        notes.append(f"{path}: {what} the time of the pose before, and is left out")
    times = np.where(same, np.nan, times)
    kept = np.flatnonzero(np.isfinite(times))
    back = kept[1:][np.diff(times[kept]) < 0]
    limits = [-np.inf, *read[0].received[back], np.inf]
    parts = []
    for start, end in zip(limits, limits[1:], strict=False):
        series = [
            _series(one, np.where(_within(one, start, end), clock, np.nan))
            for one, clock in zip(read, [times, *clocks[1:]], strict=True)
        ]
        merged: Series = {}
        for sensor in series[2:]:
            merged |= sensor
        if series[0] and series[1]:
            parts.append(Topics(series[0], merged, series[1]))
    if not parts:
        raise RecordingError(
            f"{path}: its topics have no time in common; record them together"
        )
    return parts, notes


def _within(one: Messages, start: float, end: float) -> np.ndarray:
    """Which messages (N,) were received in [start, end)."""
    return (one.received >= start) & (one.received < end)


def _repeats(one: Messages, times: np.ndarray) -> np.ndarray:
    """Which messages (N,) have the time of the message before."""
    return np.r_[False, np.diff(times) == 0]


def _series(one: Messages, times: np.ndarray) -> Series:
    """The columns of a topic at rising times; of one time the last value counts."""
    series = {}
    for name, (rows, values) in one.columns.items():
        at = times[rows]
        there = np.flatnonzero(np.isfinite(at))
        order = there[np.argsort(at[there], kind="stable")]
        last = np.r_[np.diff(at[order]) > 0, True] if len(order) else order
        if last.sum() > 1:
            series[name] = Samples(at[order][last], values[order][last])
    return series


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

    def messages(self, readers: dict[str, Reader], kind: str) -> Messages:
        """Read the one topic with messages of some types; `kind` names it in errors."""
        found = self.optional(readers, kind)
        if found is None:
            present = {f"{c.topic} ({c.msgtype})" for c in self.connections}
            raise RecordingError(
                f"{self.path}: no topic with a {kind} ({', '.join(readers)}); "
                f"there are {', '.join(sorted(present)) or 'none'}"
            )
        return found

    def optional(self, readers: dict[str, Reader], kind: str) -> Messages | None:
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
        received: list[float] = []
        stamps: list[float] = []
        found: dict[str, tuple[list[int], list[float]]] = {}
        for connection, time, raw in self.reader.messages(connections=connections):
            message = self.reader.deserialize(raw, connection.msgtype)
            # a message of a topic may be without some columns, as those of joints
            for name, value in readers[connection.msgtype](message).items():
                rows, values = found.setdefault(name, ([], []))
                rows.append(len(received))
                values.append(value)
            received.append(time * 1e-9)
            stamps.append(_stamp(message))
        if len(received) < 2:
            raise RecordingError(
                f"{self.path}: {len(received)} messages on {names[0]}, too few for a "
                "drive"
            )
        return Messages(
            names[0],
            np.array(received),
            np.array(stamps) if min(stamps) > 0 else None,
            {name: (np.array(r), np.array(v)) for name, (r, v) in found.items()},
        )


def _stamp(message: Any) -> float:
    """The time in a message's header, s; 0 without one."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return 0.0 if stamp is None else stamp.sec + stamp.nanosec * 1e-9
