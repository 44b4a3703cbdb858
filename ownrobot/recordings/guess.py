"""A first body for a recording, guessed from the names and units of its columns.

A person must check it: names do not say what a column measures.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ownrobot.recordings import checks
from ownrobot.recordings.csv_file import rate_of, read_text
from ownrobot.recordings.messages import QUATERNION, unit_of
from ownrobot.recordings.reading import (
    drives_of_paths,
    files_of,
    is_bag,
    session_and_path,
)
from ownrobot.recordings.resampling import pose_rate
from ownrobot.recordings.table import EXTRA, Findings, RecordingError, faults_of
from sidm.body import POSES, TWIST, Body, Columns, Pose, units_like
from sidm.config import replace
from sidm.drives import yaw_of

RATE = 10.0  # Hz, of the guessed body where the recording has it
#: Names of commands.
COMMAND = re.compile(
    r"(cmd|command|throttle|steer|brake|linear(_[yz])?$|angular(_[xy])?$|setpoint|action|control)"
    r".*|.*_(cmd|command|setpoint|reference|target|desired)",
    re.IGNORECASE,
)
#: Names of columns that count rows or time.
COUNTER = re.compile(r".*(time|stamp|secs|nsec).*|index|id|row|frame|", re.IGNORECASE)
#: Columns that say nothing about a robot in the plane, or what others say, too.
BESIDE_PLANE = {"z", "roll", "pitch", "vz", "wx", "wy", "wz", "az"}
BESIDE_POSE = {"x", "y", "z", "roll", "pitch", "yaw", "yaw_rate"}
MOST_GAPS = 0.5  # share of a column's cells that are no numbers, from which it is none
#: A robot leaves the plane if z or its tilt vary by more, m and rad.
UNEVEN_Z, UNEVEN_TILT = 0.2, 0.15


class _Recording(NamedTuple):
    """The columns of a file or of a bag."""

    numbers: dict[str, np.ndarray]  # (R,) each, in the units of the file
    units: dict[str, str]
    commands: list[str]
    time: list[np.ndarray]  # s, the rows of each drive
    left_out: dict[str, str]  # name -> why

    def stacked(self, names: Iterable[str]) -> np.ndarray:
        """Some columns (R, N) beside each other."""
        return np.stack([self.numbers[name] for name in names], 1)


class Guess(NamedTuple):
    """A guessed body."""

    body: Body
    notes: list[str]  # what a person must check
    left_out: dict[str, str]  # name of a column -> why it is not in the body

    @property
    def text(self) -> str:
        """The body's file, with what must be checked as comments."""
        import yaml

        body = self.body
        lines = ["# Guessed by 'ownrobot body'; check each line:"]
        lines += [f"# - {note}" for note in self.notes]
        values = {
            "name": body.name,
            "pose": body.pose,
            "columns": dict(body.columns),
            "actions": dict(body.actions),
            "rate": f"{body.rate:g} Hz",
        }
        lines.append(yaml.safe_dump(values, sort_keys=False).rstrip("\n"))
        if self.left_out:
            lines.append("# Columns of the recording that are left out:")
        lines += [f"#   {name}: {why}" for name, why in self.left_out.items()]
        return "\n".join(lines) + "\n"


def guess_body(path: str | Path, topics: Sequence[str] = ()) -> Guess:
    """A first body for the drives of a CSV file, a ROS bag, or a folder of them.

    Of a folder its first file is read, and of a bag all topics unless some are named. A
    fault, or that no column seems to be a command, raises RecordingError.

    Examples:
        >>> from ownrobot.recordings import guess_body
        >>> guess = guess_body("recordings/hunter.csv.gz")
        >>> guess.body.pose, guess.body.actions
        ('planar', (('throttle', '1'), ('steering', 'rad')))
    """
    place = session_and_path(path)[1]
    with faults_of(place):
        file = files_of(place)[0]
    with faults_of(file):
        return _guess(file, topics)


def _guess(file: Path, topics: Sequence[str]) -> Guess:
    """A first body for the drives of a CSV file or a ROS bag."""
    if is_bag(file):
        recording = _of_bag(file, topics)
    elif ".csv" in file.name.lower():
        recording = _of_csv(file)
    else:
        raise RecordingError("a body is guessed from a CSV file or a ROS bag")
    pose, why_pose = _pose(recording)
    columns, left_out = _columns(recording, pose, is_bag(file))
    if not recording.commands:
        named = [*recording.numbers, *recording.left_out] or ["no column of numbers"]
        raise RecordingError(
            "no column seems to be a command (command..., cmd..., throttle, "
            f"steering); rename one of {', '.join(named)}"
        )
    for number, time in enumerate(recording.time):
        with faults_of(f"{file}: drive {number}"):
            checks.refuse_times(time)
    rate, why_rate = _rate(recording, pose)
    body = Body(
        name=file.name.partition(".")[0],
        pose=pose,
        columns=columns,
        actions=tuple((name, recording.units[name]) for name in recording.commands),
        rate=rate,
    )
    findings = Findings(skip=True, doubtful=True)
    constant: list[str] = []
    try:
        drives = drives_of_paths([file], body, topics, findings)
        constant = checks.constant_columns(drives, body) if drives else []
    except RecordingError as error:
        findings.faults = [str(error)]
    actions = tuple(pair for pair in body.actions if pair[0] not in constant)
    if not actions:
        raise RecordingError("no command changes; record drives that steer")
    columns = tuple(pair for pair in body.columns if pair[0] not in constant)
    left_out |= dict.fromkeys(constant, "it never changes")
    *others, last = [name for name, _ in actions]
    commands = f"{', '.join(others)} and {last}" if others else last
    notes = [
        f"pose: {why_pose}",
        "columns: what the robot's sensors measure, and their units",
        f"actions: are {commands} commands, and not measurements?",
        why_rate,
        *(f"reading says: {fault}" for fault in findings.faults[:1]),
    ]
    return Guess(replace(body, columns=columns, actions=actions), notes, left_out)


def _of_csv(path: Path) -> _Recording:
    """The columns of a CSV file."""
    text = read_text(path)
    text.refuse_sparse()
    numbers, units, left_out = {}, {}, {}
    for name, unit in zip(text.names, text.units, strict=True):
        if name in EXTRA:
            continue
        if not re.fullmatch(r"[A-Za-z_]\w*", name) or text.names.count(name) > 1:
            left_out[name] = "rename it: each name once, of letters, digits and _"
            continue
        values = text.numbers(name, lenient=True)
        gaps = int(np.isnan(values).sum())
        if gaps < MOST_GAPS * len(values):
            numbers[name], units[name] = values, unit or "1"
        else:
            left_out[name] = f"{gaps} of its {len(values)} cells are no numbers"
    starts = np.zeros(0, int)
    if labels := [text.column(name) for name in EXTRA[1:] if name in text.names]:
        rows = np.stack(labels, 1)
        starts = np.flatnonzero((rows[1:] != rows[:-1]).any(1)) + 1
    if "time" in text.names:
        unit = text.units[text.names.index("time")]
        time = text.elapsed() * units_like("s").get(unit, 1.0)
    else:
        rate = rate_of(text) if "rate" in text.header else RATE
        time = np.arange(len(text.cells[0])) / rate
    commands = [name for name in numbers if COMMAND.fullmatch(name)]
    return _Recording(numbers, units, commands, np.split(time, starts), left_out)


def _of_bag(path: Path, topics: Sequence[str]) -> _Recording:
    """The columns of a ROS bag."""
    from ownrobot.recordings.bags import bag_columns  # its library is optional
    from ownrobot.recordings.topics import read_topics

    parts, _, _ = read_topics(path, topics)
    read = max(parts, key=lambda part: len(next(iter(part.pose.values())).times))
    changing = [n for n, one in read.command.items() if np.ptp(one.values) > 0]
    commands = changing or [*read.command]
    wanted = [*read.pose, *(n for n in read.sensors if n not in read.pose), *commands]
    numbers = bag_columns(read, wanted, "")
    time = numbers.pop("time")
    units = {name: unit_of(name) for name in wanted}
    return _Recording(numbers, units, commands, [time], {})


def _pose(recording: _Recording) -> tuple[Pose, str]:
    """The pose of a recording, and why."""
    names = set(recording.numbers) - set(recording.commands)
    planar, spatial = ({name for name, _ in POSES[p]} for p in ("planar", "spatial"))
    if spatial <= names:
        reason = "it has x, y, z and a quaternion"
        if not planar <= names:
            return "spatial", reason
        quaternions = recording.stacked(QUATERNION)
        tilt = 2 * np.arcsin(np.clip(np.hypot(*quaternions.T[:2]), 0, 1))
        known = np.isfinite(yaw_of(quaternions)).all()
        if np.ptp(recording.numbers["z"]) > UNEVEN_Z or (
            known and np.ptp(tilt) >= UNEVEN_TILT
        ):
            return "spatial", f"{reason}, and leaves the plane"
        return "planar", "it stays level; write spatial if the ground is not"
    if planar <= names:
        return "planar", "it has x, y and yaw; is yaw 0 along x, and positive to left?"
    return "none", "it has neither x, y, yaw nor x, y, z, qx, qy, qz, qw"


def _columns(
    recording: _Recording, pose: Pose, bag: bool
) -> tuple[Columns, dict[str, str]]:
    """The columns of a state beside the pose, and why others are left out."""
    left_out, kept = dict(recording.left_out), []
    beside = {name for columns in POSES.values() for name, _ in columns}
    if pose == "none":
        beside = set()
    elif pose == "spatial":
        beside |= BESIDE_POSE
    else:
        beside |= BESIDE_PLANE - (set() if "yaw_rate" in recording.numbers else {"wz"})
    for name in recording.numbers:
        if name in recording.commands or name in dict(POSES[pose]):
            continue
        if COUNTER.fullmatch(name):
            left_out[name] = "it seems to count rows or time"
        elif name in beside:
            left_out[name] = "it says little beside the pose"
        elif bag and name.endswith(("_position", "_effort")) or name in ("ax", "ay"):
            left_out[name] = f"{recording.units[name]}; add it if it helps"
        else:
            kept.append(name)
    twist = [name for name, _ in TWIST]
    if pose == "spatial" and set(twist) <= set(kept):
        kept = twist + [name for name in kept if name not in twist]
    return tuple((name, recording.units[name]) for name in kept), left_out


def _rate(recording: _Recording, pose: Pose) -> tuple[float, str]:
    """The rate of the body's steps, Hz, and why."""
    rows = 1 / float(np.median(np.concatenate([np.diff(t) for t in recording.time])))
    rate, reason = rows, f"the rows come at {rows:.3g} Hz"
    if pose != "none":
        ends = np.cumsum([len(time) for time in recording.time])[:-1]
        poses = np.split(recording.stacked(dict(POSES[pose])), ends)
        new = pose_rate(zip(recording.time, poses, strict=True))
        if new is not None and new < 0.9 * rows:
            rate, reason = new, f"{reason}, and its pose is new at {new:.3g} Hz"
    if checks.SLOWEST > rate:
        reason += "; is 'time' in ms?"
    if rate > RATE / 1.25:
        return RATE, f"rate: steps a second; {reason}"
    return checks.plain_rate(rate), f"rate: {reason}"
