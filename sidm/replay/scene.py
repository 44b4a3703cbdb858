"""Scenes: what a replay shows, robots that move over a piece of ground; made of rides, recordings and predictions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from sidm.config import ConfigError, replace
from sidm.drives import POSITION, QUATERNION, Drive, Ground
from sidm.replay.rides import Ride
from sidm.replay.skeleton import BOXES, Box, Skeleton, box_skeleton, rover_skeleton
from sidm.systems import Robot
from sidm.terrain import height_at

#: told apart by colour-blind readers, too
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
SPACING = 0.1  # m, of the simulated ground
MARGIN = 4.0  # m of ground around the ways
TRUTH = "#F2F2EE"  # the robot that really drove, beside colours of models
GHOST = 0.42  # opacity
#: wheelbase, track and tyres' radius of the paper's robots, m
ROVER_WHEELS = 0.685, 0.360, 0.100
ROVER_JOINTS = 10


class Track(NamedTuple):
    """A robot's motion; T + 1 moments."""

    name: str
    step: float  # s between moments
    position: np.ndarray  # (T + 1, 3), m, of the body's frame
    quaternion: np.ndarray  # (T + 1, 4), x, y, z, w, body to world
    joints: np.ndarray  # (T + 1, J), rad, what the skeleton's joints name
    skeleton: Skeleton
    colour: str = COLOURS[0]
    ghost: float = 0.0  # opacity of a translucent robot; 0: it is solid


class Scene(NamedTuple):
    """Tracks over ground, the one that matters first."""

    tracks: tuple[Track, ...]
    ground: Ground
    distance: float = 2.4  # m, of the camera
    label: str = ""


def ride_track(
    ride: Ride, name: str = "robot", colour: str = COLOURS[0], ghost: float = 0.0
) -> Track:
    """A simulated ride."""
    skeleton = rover_skeleton(ride.robot, ride.strut_motors)
    position, quaternion = ride.states[:, POSITION], ride.states[:, QUATERNION]
    return Track(
        name,
        float(ride.times[1]),
        position,
        quaternion,
        ride.joints,
        skeleton,
        colour,
        ghost,
    )


def rides_scene(rides: Ride | Mapping[str, Ride]) -> Scene:
    """Rides by their names over the ground of the first; from the second on they are ghosts."""
    named = {"robot": rides} if isinstance(rides, Ride) else rides
    tracks = [
        ride_track(one, name, COLOURS[number % len(COLOURS)], GHOST if number else 0.0)
        for number, (name, one) in enumerate(named.items())
    ]
    return Scene(tuple(tracks), Ground(next(iter(named.values())).heights, SPACING))


def rolled(
    position: np.ndarray, quaternion: np.ndarray, radius: float, half_track: float = 0.0
) -> np.ndarray:
    """Angles (T + 1, 4), rad, of wheels that roll without slip: rear right, rear left, front right, front left.

    Args:
        position: (T + 1, 3), m.
        quaternion: (T + 1, 4).
        radius: of the wheels, m.
        half_track: how far they stand from the middle, m; in a bend the outer ones turn
            faster.
    """
    turns = Rotation.from_quat(quaternion)
    ahead = turns[:-1].inv().apply(np.diff(position, axis=0))[:, 0]
    turned = (turns[:-1].inv() * turns[1:]).as_rotvec()[:, 2]
    sides = [ahead + half_track * turned, ahead - half_track * turned]
    return (
        np.vstack([np.zeros(4), np.cumsum(np.stack(sides * 2, axis=1), axis=0)])
        / radius
    )


def laid(
    path: np.ndarray,
    ground: Ground,
    base: float,
    track: float,
    yaw: np.ndarray | None = None,
) -> Rotation:
    """Attitudes (T + 1) of a robot on four wheels whose way (T + 1, 2) over a ground is all that is known.

    Args:
        path: x and y, m.
        ground: that it stands on.
        base: wheelbase, m.
        track: m.
        yaw: (T + 1,), rad; along the way unless given.
    """
    if yaw is None:
        # A robot that hardly moves keeps the heading that it has been given last.
        move = np.gradient(path, axis=0)
        fast = np.flatnonzero(np.hypot(*move.T) > 0.005)
        angle = np.unwrap(np.arctan2(*move[fast].T[::-1])) if len(fast) else np.zeros(1)
        yaw = np.interp(np.arange(len(path)), fast if len(fast) else [0], angle)
    ahead, left = (
        np.array([np.cos(yaw), np.sin(yaw)]).T,
        np.array([-np.sin(yaw), np.cos(yaw)]).T,
    )

    def slope(direction: np.ndarray, length: float) -> np.ndarray:
        high, low = (
            height_on(ground, path + sign * length / 2 * direction) for sign in (1, -1)
        )
        return np.arctan((high - low) / length)

    return Rotation.from_euler(
        "ZYX", np.stack([yaw, -slope(ahead, base), slope(left, track)], axis=1)
    )


def height_on(ground: Ground, points: np.ndarray) -> np.ndarray:
    """Heights (N,), m, of the ground at points (N, 2), m."""
    x, y = (points - np.array(ground.centre)).T
    return height_at(ground.heights, x, y, ground.spacing)


def drive_track(
    drive: Drive, ground: Ground, like: Box | Robot, name: str, colour: str
) -> Track:
    """A recorded drive, of a planar or a spatial pose, by a robot that looks like this one; its wheels roll."""
    body, pose = drive.body, drive.states[:, : drive.body.pose_size]
    box, planar = isinstance(like, Box), body.pose == "planar"
    base, track, radius = (
        (like.wheelbase, like.track, like.radius)
        if isinstance(like, Box)
        else ROVER_WHEELS
    )
    if planar:
        above = 0.0 if box else radius
        position = np.column_stack(
            [pose[:, :2], height_on(ground, pose[:, :2]) + above]
        )
        turn = laid(pose[:, :2], ground, base, track, pose[:, 2]).as_quat()
    else:
        position, turn = pose[:, :3], pose[:, 3:7]
    skeleton = (
        box_skeleton(like, on_ground=planar)
        if isinstance(like, Box)
        else rover_skeleton(like)
    )
    joints = wheels = rolled(position, turn, radius, track / 2)
    if not box:
        joints = np.zeros((len(wheels), ROVER_JOINTS))
        joints[:, 4:8] = wheels
    return Track(name, 1 / body.rate, position, turn, joints, skeleton, colour)


def drives_scene(drives: Iterable[Drive], like: Box | Robot = BOXES["husky"]) -> Scene:
    """Recorded drives over the ground of the first, or over level ground where none was recorded.

    Raises:
        ConfigError: the body has no pose, so that one does not know where it was.
    """
    drives = list(drives)
    body = drives[0].body
    if body.pose == "none":
        raise ConfigError(
            f"body '{body.name}' has no pose; a replay needs pose: planar or spatial"
        )
    places = np.concatenate([drive.states[:, :2] for drive in drives])
    # Positions are relative to the middle of a recorded ground.
    below = drives[0].ground
    ground = Ground(below.heights, below.spacing) if below else level(places)
    tracks = [
        drive_track(drive, ground, like, drive.name, COLOURS[number % len(COLOURS)])
        for number, drive in enumerate(drives)
    ]
    base = like.wheelbase if isinstance(like, Box) else ROVER_WHEELS[0]
    return Scene(tuple(tracks), ground, 3.5 * base)


def predicted_scene(
    drive: Drive,
    path: np.ndarray,
    like: Box,
    names: tuple[str, str] = ("the robot", "model"),
) -> Scene:
    """A recorded drive over level ground, and as a ghost where a model says that the robot would be.

    Args:
        drive: of a planar pose.
        path: the states (K + 1, S) that a model predicts from the drive's start, as
            `Model.rollout` gives them.
        like: what the robot looks like.
        names: of the robot and of the model, for the legend.
    """
    ground = level(np.concatenate([drive.states[:, :2], path[:, :2]]))
    robot = drive_track(drive, ground, like, names[0], TRUTH)
    ghost = drive_track(replace(drive, states=path), ground, like, names[1], COLOURS[1])
    return Scene(
        (robot, ghost._replace(ghost=GHOST)),
        ground,
        4.5 * like.wheelbase,
        f"{names[0]} and {names[1]}",
    )


def level(places: np.ndarray) -> Ground:
    """Level ground around places (N, 2), m."""
    low, high = places.min(0) - 2 * MARGIN, places.max(0) + 2 * MARGIN
    centre = (low + high) / 2
    columns, rows = np.ceil((high - low) / 0.5).astype(int) + 1
    return Ground(np.zeros((rows, columns)), 0.5, (float(centre[0]), float(centre[1])))
