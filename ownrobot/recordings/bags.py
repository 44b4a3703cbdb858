"""Read drives from ROS bags, version 1 or 2, as tables.

The module `messages` says which columns a message gives, `clocks` when it counts. The
table has a row for each pose. Other sensors are interpolated, but not across a pause of
theirs: the rows in it are left out. A command holds until the next one; a row has the
mean of the commands until the next row.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ownrobot.recordings import checks
from ownrobot.recordings.checks import GAP
from ownrobot.recordings.clocks import Messages, on_one_clock
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

QUATERNION = ("qx", "qy", "qz", "qw")
LONG_PAUSE = 1.0  # s without a command, from which a note tells that the last one holds


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


def read_bag(path: Path, body: Body, topics: Sequence[str] = ()) -> Table:
    """Read the columns of a body from a bag.

    Where the clock of the poses goes back, a new drive begins.

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
    parts, notes = read_topics(path, topics)
    pieces = [bag_columns(path, part, wanted, body.name) for part in parts]
    notes += _notes_of_commands(path, parts, wanted)
    columns = {n: np.concatenate([piece[n] for piece in pieces]) for n in pieces[0]}
    lengths = [len(piece["time"]) for piece in pieces]
    labels = {}
    if len(parts) > 1:
        notes.append(
            f"{path}: the clock of its poses goes back {len(parts) - 1} times; a drive "
            "begins there"
        )
        numbers = np.arange(len(parts)).astype(str)
        labels["drive"] = np.repeat(numbers, lengths)
    if session := _session(path):
        labels["session"] = np.repeat([session], sum(lengths))
    return Table(str(path), columns, labels, None, notes=notes)


def _session(path: Path) -> str:
    """The session of a bag that a recorder split into NAME_0, NAME_1, ...; else ''."""
    found = re.fullmatch(r"(.+)_\d+(\.\w+)?", path.name)
    if not found:
        return ""
    pattern = rf"{re.escape(found[1])}_\d+{re.escape(found[2] or '')}"
    beside = [one for one in path.parent.iterdir() if re.fullmatch(pattern, one.name)]
    return str(path.parent / found[1]) if len(beside) > 1 else ""


def _notes_of_commands(
    path: Path, parts: Sequence[Topics], wanted: Sequence[str]
) -> list[str]:
    """What is said of a bag's commands: parts that are not read, and pauses."""
    commands = parts[0].command
    changing = [
        name
        for name in commands
        if name not in wanted
        and any(np.ptp(part.command[name].values) > 0 for part in parts)
    ]
    notes = []
    if changing and any(name in commands for name in wanted):
        notes.append(
            f"{path}: {', '.join(changing)} of the command changes and is not read; "
            "name it among the actions of the body"
        )
    gaps = [
        np.diff(part.command[name].times)
        for part in parts
        for name in wanted
        if name in part.command
    ]
    longest = max((float(gap.max()) for gap in gaps if len(gap)), default=0.0)
    usual = float(np.median(np.concatenate(gaps))) if longest else 0.0
    if longest > max(LONG_PAUSE, GAP * usual):
        notes.append(
            f"{path}: commands pause for up to {longest:.3g} s; the last one is held"
        )
    return notes


def read_topics(
    path: Path, topics: Sequence[str] = ()
) -> tuple[list[Topics], list[str]]:
    """Read the pose, the sensors and the command of a bag; errors as in `read_bag`.

    Returns:
        The topics, in several parts where the clock of the poses goes back; and lines
        about clocks and messages that are left out.
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
    return _parts(path, [pose, command, *sensors])


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
    if {"yaw", *QUATERNION} & set(wanted):
        quaternions = np.stack([topics.pose[name].values for name in QUATERNION], 1)
        checks.unit_quaternions(f"{path}: orientation", quaternions)
    time = _times_in_common(path, poses.times, sensors, commands or topics.command)
    columns = {}
    for name in wanted:
        if name in commands:
            columns[name] = _held_means(commands[name], time)
        elif name in sensors:
            columns[name] = np.interp(time, *sensors[name])
        else:
            columns[name] = topics.pose[name].values[np.isin(poses.times, time)]
    return columns | {"time": time}


def _held_means(command: Samples, time: np.ndarray) -> np.ndarray:
    """Means (R,) of a command, held until the next one, from each row to the next.

    A row before a pause has the mean over a usual spacing of the rows.
    """
    spacing = float(np.median(np.diff(time)))
    ends = np.minimum(np.r_[time[1:], np.inf], time + GAP * spacing)
    ends[-1] = time[-1] + spacing
    steps = np.r_[0.0, np.cumsum(np.diff(command.times) * command.values[:-1])]

    def integral(at: np.ndarray) -> np.ndarray:
        held = np.searchsorted(command.times, at, side="right") - 1
        return steps[held] + (at - command.times[held]) * command.values[held]

    return (integral(ends) - integral(time)) / (ends - time)


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
