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
from ownrobot.recordings.table import Findings
from sidm.body import Body
from sidm.drives import QUATERNION, Drive, yaw_of

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


class Off(NamedTuple):
    """A drive whose motion is off its yaw."""

    drive: int  # number of the drive
    degrees: float  # median angle from where the robot should go to where it goes


class Headings(NamedTuple):
    """The drives of a file that are off."""

    off: list[Off]
    judged: int  # drives that move enough to tell

    @property
    def most(self) -> bool:
        """Whether most of the drives are off, so that the file is."""
        return 2 * len(self.off) > self.judged


class _Stretches(NamedTuple):
    """Straight stretches of one drive."""

    angles: np.ndarray  # (N,) rad, from the yaw to the direction of motion
    forward: np.ndarray  # (N,) m/s, along the yaw
    columns: np.ndarray  # (N, C), means of the body's columns and actions


def check_headings(drives: Sequence[Drive], body: Body) -> Headings:
    """The drives of one file that are off their yaw."""
    names = [name for name, _ in body.columns]
    if body.pose == "none" or has_twist(body) or "vy" in names:
        return Headings([], 0)
    stretches = [_stretches(drive, body) for drive in drives]
    judged = [
        number
        for number, part in enumerate(stretches)
        if len(part.angles) >= FEWEST_STRETCHES
    ]
    if not judged:
        return Headings([], 0)
    directions = _directions([stretches[number] for number in judged])
    angles = {
        number: _wrapped(stretches[number].angles - direction)
        for number, direction in zip(judged, directions, strict=True)
    }
    limit = MEDIAN_OFF
    middle = np.array([np.median(np.abs(values)) for values in angles.values()])
    if np.median(middle) > ALONG:
        if _alike(np.concatenate(list(angles.values()))) < ALIKE:  # in all directions
            return Headings([], len(judged))
        limit = OFF if len(judged) >= FEWEST_DRIVES else limit
    off = [
        Off(number, float(np.degrees(np.angle(np.exp(1j * values).sum()))))
        for number, values in angles.items()
        if np.mean(np.abs(values) > OFF) >= OFTEN and np.median(np.abs(values)) > limit
    ]
    return Headings(off, len(judged))


def yaw_fault(drives: Sequence[Drive], body: Body) -> str:
    """What is wrong with the yaw of all drives of a file; '' where nothing is seen.

    A yaw is constant while the robot drives in several directions, is positive to the
    right, in another unit, or off by a constant.
    """
    names = [name for name, _ in body.columns]
    if body.pose == "none" or has_twist(body) or "vy" in names or not drives:
        return ""
    length = max(1, round(STRETCH * body.rate))
    parts = [_straight(drive, body, length) for drive in drives]
    directions, yaw = (np.concatenate(part) for part in zip(*parts, strict=True))
    several = len(yaw) >= FEWEST_TOGETHER and _alike(directions) < ONE_WAY
    if not several:
        return ""
    if _alike(directions - yaw) >= ALIKE:
        off = float(np.angle(np.exp(2j * (directions - yaw)).mean()) / 2)
        if abs(off) <= ALONG or len(drives) >= FEWEST_DRIVES:
            return ""  # many drives are judged one by one
        return f"yaw is {abs(np.degrees(off)):.0f} degrees off the direction of motion"
    others = {
        "turned to the right; it must be positive to the left": directions + yaw,
        "in degrees": directions - np.radians(yaw),
        "in radians, and called degrees": directions - np.degrees(yaw),
    }
    best = max(others, key=lambda words: _alike(others[words]))
    if _alike(others[best]) >= ALIKE:
        return f"yaw seems to be {best}"
    if _alike(yaw) >= ONE_WAY:
        return "yaw hardly changes, while the robot drives in several directions"
    return ""


def _straight(drive: Drive, body: Body, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions of motion and yaw (N,), rad, of straight stretches of a drive."""
    xy = drive.states[:, :2]
    if len(xy) <= length:
        return np.zeros(0), np.zeros(0)
    way = xy[length:] - xy[:-length]
    steps = np.linalg.norm(np.diff(xy, axis=0), axis=1)
    path = np.r_[0.0, np.cumsum(steps)]
    reached = np.hypot(*way.T)
    kept = (reached > LEAST_WAY) & (
        reached > STRAIGHT * (path[length:] - path[:-length])
    )
    yaw = _yaw(drive, body)
    middle = (yaw[length:] + yaw[:-length]) / 2
    return np.arctan2(way[:, 1], way[:, 0])[kept], middle[kept]


def _yaw(drive: Drive, body: Body) -> np.ndarray:
    """Yaw (K + 1,), rad, without jumps."""
    if body.pose == "planar":
        return drive.states[:, 2]
    return np.unwrap(yaw_of(drive.states[:, QUATERNION]))


def _alike(angles: np.ndarray) -> float:
    """Length of the mean vector of doubled angles: 1 where they are one axis."""
    return float(np.abs(np.exp(2j * angles).mean())) if len(angles) else 0.0


def drives_along_yaw(
    where: str, drives: list[Drive], body: Body, findings: Findings
) -> list[Drive]:
    """The drives of a file whose motion fits their yaw.

    Others are left out where faults are skipped, and told in a note otherwise. They are
    refused where they are most of the file, or where the yaw of all has one fault.
    """
    if fault := yaw_fault(drives, body):
        findings.add(
            f"{where}: {fault} (a robot that moves sideways has a column 'vy')"
        )
        return []
    headings = check_headings(drives, body)
    if headings.most:
        degrees = float(np.median([abs(one.degrees) for one in headings.off]))
        findings.add(
            f"{where}: {len(headings.off)} of {headings.judged} drives move "
            f"{degrees:.0f} degrees off their yaw; are yaw, x and y of one frame, and "
            "is yaw 0 along x? (a robot that moves sideways has a column 'vy')"
        )
        return []
    if not findings.doubtful:
        for number, degrees in headings.off:
            findings.add(
                f"{drives[number].name}: it moves {degrees:.0f} degrees off its yaw, "
                "as other drives do not; check its pose"
            )
    elif headings.off:
        findings.notes.append(_note(where, drives, headings))
    off = set() if findings.doubtful else {one.drive for one in headings.off}
    return [drive for number, drive in enumerate(drives) if number not in off]


def _note(where: str, drives: Sequence[Drive], headings: Headings) -> str:
    """The note about a few drives of a file that are off."""
    names = [
        f"{drives[number].name.removeprefix(where).strip()} ({degrees:.0f} degrees)"
        for number, degrees in headings.off
    ]
    names[NAMED:] = ["..."] if len(names) > NAMED else []
    return (
        f"{where}: {len(headings.off)} of {headings.judged} drives do not move along "
        f"their yaw: {', '.join(names)}; check their poses, or leave them out "
        "(--skip-bad, skip_bad=True)"
    )


def _stretches(drive: Drive, body: Body) -> _Stretches:
    """The stretches of a drive that are straight and long enough."""
    length = max(1, round(STRETCH * body.rate))
    states, rates = drive.states, np.hstack([drive.states[:-1], drive.actions])
    columns = rates[:, body.pose_size :]
    if len(columns) < length:
        empty = np.zeros(0)
        return _Stretches(empty, empty, np.zeros((0, columns.shape[1])))
    yaw = _yaw(drive, body)
    way = states[length:, :2] - states[:-length, :2]
    turn = np.abs(yaw[length:] - yaw[:-length])
    middle = (yaw[length:] + yaw[:-length]) / 2
    angles = _wrapped(np.arctan2(way[:, 1], way[:, 0]) - middle)
    long = np.hypot(*way.T)
    sums = np.cumsum(np.vstack([np.zeros(columns.shape[1]), columns]), axis=0)
    means = (sums[length:] - sums[:-length]) / length
    kept = (long > LEAST_WAY) & (turn < MOST_TURN)
    forward = long * np.cos(angles) * body.rate / length
    return _Stretches(angles[kept], forward[kept], means[kept])


def _directions(parts: Sequence[_Stretches]) -> list[np.ndarray]:
    """Where robots should go in each stretch, rad from the yaw: 0 or pi.

    The columns say it where they predict the motion along the yaw. In other stretches
    it is the nearer of both.
    """
    forward = np.concatenate([part.forward for part in parts])
    columns = np.concatenate([part.columns for part in parts])
    scaled = columns / np.maximum(np.abs(columns).max(0), 1e-12)
    inputs = np.column_stack([scaled, np.ones(len(scaled))])
    weights = np.linalg.lstsq(inputs, forward, rcond=None)[0]
    predicted = inputs @ weights
    variance = np.mean((forward - forward.mean()) ** 2)
    explains = np.mean((forward - predicted) ** 2) < (1 - EXPLAINED) * variance
    known = explains & (np.abs(predicted) > CLEAR)
    backwards = np.where(known, predicted, forward) < 0
    lengths = np.cumsum([len(part.angles) for part in parts])[:-1]
    return np.split(np.where(backwards, np.pi, 0.0), lengths)


def _wrapped(angles: np.ndarray) -> np.ndarray:
    """Angles, rad, in [-pi, pi)."""
    return (angles + np.pi) % (2 * np.pi) - np.pi
