"""Drives that move in another direction than their yaw says.

A robot with wheels moves along its yaw, forwards or backwards, while it goes straight.
A pose that was matched wrongly moves another way during a whole drive. All drives of a
file tell together whether the robot goes along its yaw, and which of its columns say
that it goes backwards. Robots that also move sideways are not judged, nor bodies with a
twist, whose velocities are compared with their poses (`frames`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ownrobot.recordings.checks import has_twist
from ownrobot.recordings.frames import yaw_of_drive
from ownrobot.recordings.table import Findings, RecordingError
from sidm.body import Body
from sidm.drives import Drive

STRETCH = 0.4  # s, over which a direction is measured
#: A stretch counts if it is at least LEAST_WAY m long and turns by less than MOST_TURN
#: rad; a drive is judged by at least FEWEST_STRETCHES.
LEAST_WAY, MOST_TURN, FEWEST_STRETCHES = 0.12, 0.5, 5
#: A stretch is off by more than OFF rad. A drive is off if at least OFTEN of its
#: stretches are, and the median by more than MEDIAN_OFF rad.
OFF, OFTEN, MEDIAN_OFF = np.radians(45), 0.8, np.radians(60)
#: A robot moves along its yaw if half of its drives are nearer to it than ALONG rad.
#: Otherwise the yaw is off in all of at least FEWEST_DRIVES drives, if stretches are
#: off alike: doubled angles have a mean vector of at least this length.
ALONG, FEWEST_DRIVES, ALIKE = np.radians(30), 5, 0.7
NAMED = 10  # drives that a note names
#: The yaw of all drives together is judged by at least this many stretches in which the
#: way is STRAIGHT times the path, if these go in several directions: the mean vector of
#: doubled angles is shorter than ONE_WAY. A yaw whose vector is longer is constant.
FEWEST_TOGETHER, STRAIGHT, ONE_WAY = 20, 0.97, 0.9
#: Columns tell forwards from backwards if they explain this share of the variance, and
#: in a stretch if they say at least CLEAR m/s.
EXPLAINED, CLEAR = 0.7, 0.15
SIDEWAYS = "(a robot that moves sideways has a column 'vy')"


class _Stretches(NamedTuple):
    """Stretches of one drive."""

    course: np.ndarray  # (N,) rad, direction of motion
    yaw: np.ndarray  # (N,) rad, mean
    speed: np.ndarray  # (N,) m/s
    columns: np.ndarray  # (N, C), means of the body's columns and actions
    level: np.ndarray  # (N,) whether it is long and turns little
    straight: np.ndarray  # (N,) whether it is long and straight


def drives_along_yaw(
    where: str, drives: list[Drive], body: Body, findings: Findings
) -> list[Drive]:
    """The drives of a file whose motion fits their yaw.

    Others are left out where faults are skipped, and told in a note otherwise. They are
    refused where they are most of the file, or where the yaw of all has one fault.
    """
    sideways = "vy" in dict(body.columns)
    if not drives or body.pose == "none" or has_twist(body) or sideways:
        return drives
    stretches = [_stretches(drive, body) for drive in drives]
    if fault := _fault_of_all(stretches):
        raise RecordingError(f"{fault} {SIDEWAYS}")
    off, judged = _off(stretches)
    if 2 * len(off) > judged:
        degrees = float(np.median(np.abs([*off.values()])))
        raise RecordingError(
            f"{len(off)} of {judged} drives move {degrees:.0f} degrees off their yaw; "
            f"are yaw, x and y of one frame, and is yaw 0 along x? {SIDEWAYS}"
        )
    if not findings.doubtful:
        for number, degrees in off.items():
            fault = (
                f"it moves {degrees:.0f} degrees off its yaw, as other drives do not; "
                "check its pose"
            )
            findings.add(RecordingError(fault, drives[number].name))
        return [drive for number, drive in enumerate(drives) if number not in off]
    if off:
        names = [
            f"{drives[number].name.removeprefix(where).strip()} ({degrees:.0f} degrees)"
            for number, degrees in off.items()
        ]
        names[NAMED:] = ["..."] if len(names) > NAMED else []
        findings.notes.append(
            f"{where}: {len(off)} of {judged} drives do not move along their yaw: "
            f"{', '.join(names)}; check their poses, or leave them out "
            "(--skip-bad, skip_bad=True)"
        )
    return drives


def _stretches(drive: Drive, body: Body) -> _Stretches:
    """All stretches of a drive, of which neighbours overlap."""
    length = max(1, round(STRETCH * body.rate))
    states, yaw = drive.states, yaw_of_drive(drive)
    columns = np.hstack([states[:-1], drive.actions])[:, body.pose_size :]
    if len(drive) < length:
        none, no = np.zeros(0), np.zeros(0, bool)
        return _Stretches(none, none, none, columns[:0], no, no)

    def over(sums: np.ndarray) -> np.ndarray:
        return sums[length:] - sums[:-length]

    def summed(steps: np.ndarray) -> np.ndarray:
        return np.cumsum(np.concatenate([np.zeros_like(steps[:1]), steps]), axis=0)

    way = over(states[:, :2])
    reached, turn = np.hypot(*way.T), np.abs(over(yaw))
    path = over(summed(np.linalg.norm(np.diff(states[:, :2], axis=0), axis=1)))
    long = reached > LEAST_WAY
    return _Stretches(
        np.arctan2(way[:, 1], way[:, 0]),
        (yaw[length:] + yaw[:-length]) / 2,
        reached * body.rate / length,
        over(summed(columns)) / length,
        long & (turn < MOST_TURN),
        long & (reached > STRAIGHT * path),
    )


def _fault_of_all(stretches: Sequence[_Stretches]) -> str:
    """What is wrong with the yaw of all drives of a file; '' where nothing is seen."""
    course = np.concatenate([one.course[one.straight] for one in stretches])
    yaw = np.concatenate([one.yaw[one.straight] for one in stretches])
    if len(yaw) < FEWEST_TOGETHER or _alike(course) >= ONE_WAY:
        return ""
    if _alike(course - yaw) >= ALIKE:
        off = float(np.angle(np.exp(2j * (course - yaw)).mean()) / 2)
        if abs(off) <= ALONG or len(stretches) >= FEWEST_DRIVES:
            return ""  # many drives are judged one by one
        return f"yaw is {abs(np.degrees(off)):.0f} degrees off the direction of motion"
    others = {
        "turned to the right; it must be positive to the left": course + yaw,
        "in degrees": course - np.radians(yaw),
        "in radians, and called degrees": course - np.degrees(yaw),
    }
    best = max(others, key=lambda words: _alike(others[words]))
    if _alike(others[best]) >= ALIKE:
        return f"yaw seems to be {best}"
    if _alike(yaw) >= ONE_WAY:
        return "yaw hardly changes, while the robot drives in several directions"
    return ""


def _off(stretches: Sequence[_Stretches]) -> tuple[dict[int, float], int]:
    """Drives that are off -> degrees; and how many drives are judged."""
    counts = [int(one.level.sum()) for one in stretches]
    judged = [n for n, count in enumerate(counts) if count >= FEWEST_STRETCHES]
    if not judged:
        return {}, 0
    course, yaw, speed, columns = (
        np.concatenate([stretches[n][part][stretches[n].level] for n in judged])
        for part in range(4)
    )
    angles = _wrapped(course - yaw)
    backwards = _backwards(speed * np.cos(angles), columns)
    angles = _wrapped(angles - np.where(backwards, np.pi, 0.0))
    parts = np.split(angles, np.cumsum([counts[n] for n in judged])[:-1])
    middle = [np.median(np.abs(part)) for part in parts]
    limit = MEDIAN_OFF
    if np.median(middle) > ALONG:
        if _alike(angles) < ALIKE:  # in all directions
            return {}, len(judged)
        limit = OFF if len(judged) >= FEWEST_DRIVES else limit
    off = {
        number: float(np.degrees(np.angle(np.exp(1j * part).sum())))
        for number, part, half in zip(judged, parts, middle, strict=True)
        if np.mean(np.abs(part) > OFF) >= OFTEN and half > limit
    }
    return off, len(judged)


def _backwards(forward: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Where (N,) robots go backwards, by columns (N, C), or velocities (N,) alone."""
    scaled = columns / np.maximum(np.abs(columns).max(0), 1e-12)
    inputs = np.column_stack([scaled, np.ones(len(scaled))])
    predicted = inputs @ np.linalg.lstsq(inputs, forward, rcond=None)[0]
    explains = np.mean((forward - predicted) ** 2) < (1 - EXPLAINED) * forward.var()
    known = explains & (np.abs(predicted) > CLEAR)
    return np.where(known, predicted, forward) < 0


def _alike(angles: np.ndarray) -> float:
    """Length of the mean vector of doubled angles: 1 where they are one axis."""
    return float(np.abs(np.exp(2j * angles).mean())) if len(angles) else 0.0


def _wrapped(angles: np.ndarray) -> np.ndarray:
    """Angles, rad, in [-pi, pi)."""
    return (angles + np.pi) % (2 * np.pi) - np.pi
