"""Read drives from ROS bags, version 1 or 2, as tables.

The module `topics` reads a bag, `messages` says which columns a message gives, `clocks`
when it counts. The table has a row for each pose. Other sensors are interpolated, but
not across a pause of theirs: the rows in it are left out. A command holds until the
next one; a row has the mean of the commands until the next row.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ownrobot.recordings import checks
from ownrobot.recordings.checks import GAP
from ownrobot.recordings.messages import QUATERNION
from ownrobot.recordings.table import RecordingError, Table
from ownrobot.recordings.topics import Samples, Topics, read_topics
from sidm.body import Body
from sidm.config import hint

LONG_PAUSE = 1.0  # s without a command, from which a note tells that the last one holds


def read_bag(path: Path, body: Body, topics: Sequence[str] = ()) -> Table:
    """Read the columns of a body from a bag, of all topics unless some are given.

    Where the clock of the poses goes back, a new drive begins.
    """
    wanted = [name for name, _ in (*body.state, *body.actions)]
    parts, notes, session = read_topics(path, topics)
    pieces = [bag_columns(part, wanted, body.name) for part in parts]
    notes += _notes_of_commands(parts, wanted)
    notes += filter(None, map(_note_of_cut, parts, pieces))
    columns = {n: np.concatenate([piece[n] for piece in pieces]) for n in pieces[0]}
    labels = {}
    if len(parts) > 1:
        notes.append(
            f"the clock of its poses goes back {len(parts) - 1} times; a drive "
            "begins there"
        )
        numbers = np.arange(len(parts)).astype(str)
        labels["drive"] = np.repeat(numbers, [len(piece["time"]) for piece in pieces])
    return Table(str(path), columns, labels, None, notes=notes, session=session)


def _note_of_cut(topics: Topics, columns: dict[str, np.ndarray]) -> str:
    """What is said of poses before and after the other topics' messages; ''."""
    poses, time = next(iter(topics.pose.values())).times, columns["time"]
    cut = time[0] - poses[0], poses[-1] - time[-1]
    if max(cut) < LONG_PAUSE:
        return ""
    return (
        f"{cut[0]:.3g} s at its start and {cut[1]:.3g} s at its end have poses without "
        "commands or other sensors, and are left out"
    )


def _notes_of_commands(parts: Sequence[Topics], wanted: Sequence[str]) -> list[str]:
    """What is said of a bag's commands: parts that are not read, and pauses."""
    commands, notes = parts[0].command, []
    changing = [
        name
        for name in commands
        if name not in wanted
        and any(np.ptp(part.command[name].values) > 0 for part in parts)
    ]
    if changing and any(name in commands for name in wanted):
        notes.append(
            f"{', '.join(changing)} of the command changes and is not read; "
            "name it among the actions of the body"
        )
    read = [(part, name) for part in parts for name in wanted if name in part.command]
    gaps = np.concatenate(
        [np.zeros(0), *(np.diff(part.command[name].times) for part, name in read)]
    )
    if len(gaps) and gaps.max() > max(LONG_PAUSE, GAP * np.median(gaps)):
        notes.append(
            f"commands pause for up to {gaps.max():.3g} s; the last one is held"
        )
    return notes


def bag_columns(
    topics: Topics, wanted: Sequence[str], body: str
) -> dict[str, np.ndarray]:
    """The wanted columns and `time`, s, (R,), at poses within all topics' times."""
    known = topics.pose | topics.sensors | topics.command
    for name in wanted:
        if name not in known:
            raise RecordingError(
                f"column '{name}' of body '{body}' is in no topic; {hint(name, known)}"
            )
    # a sensor of the same name as a part of the pose's message comes first
    sensors = {n: topics.sensors[n] for n in wanted if n in topics.sensors}
    commands = {n: topics.command[n] for n in wanted if n in topics.command}
    poses = next(iter(topics.pose.values())).times
    if {"yaw", *QUATERNION} & set(wanted):
        quaternions = np.stack([topics.pose[name].values for name in QUATERNION], 1)
        checks.unit_quaternions(quaternions, "orientation: ")
    others = [*sensors.values(), *(commands or topics.command).values()]
    inside = (poses >= max(one.times[0] for one in others)) & (
        poses <= min(one.times[-1] for one in others)
    )
    for times, _ in sensors.values():  # nothing is interpolated across a pause
        steps = np.diff(times)
        pause = steps > GAP * max(np.median(np.diff(poses)), np.median(steps))
        after = np.clip(np.searchsorted(times, poses, side="right"), 1, len(steps))
        inside &= ~pause[after - 1] | np.isin(poses, times)
    if inside.sum() < 2:
        raise RecordingError("its topics have no time in common; record them together")
    time, columns = poses[inside], {}
    for name in wanted:
        if name in commands:
            columns[name] = _held_means(commands[name], time)
        elif name in sensors:
            columns[name] = np.interp(time, *sensors[name])
        else:
            columns[name] = topics.pose[name].values[inside]
    return columns | {"time": time}


def _held_means(command: Samples, time: np.ndarray) -> np.ndarray:
    """Means (R,) of a command from each row to the next, or to a pause."""
    spacing = float(np.median(np.diff(time)))
    ends = np.minimum(np.r_[time[1:], np.inf], time + GAP * spacing)
    ends[-1] = time[-1] + spacing
    steps = np.r_[0.0, np.cumsum(np.diff(command.times) * command.values[:-1])]

    def integral(at: np.ndarray) -> np.ndarray:
        held = np.searchsorted(command.times, at, side="right") - 1
        return steps[held] + (at - command.times[held]) * command.values[held]

    return (integral(ends) - integral(time)) / (ends - time)
