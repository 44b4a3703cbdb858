"""Scenes: robots that move over ground, from rides, recordings and predictions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ownrobot.replay.rides import Ride
from ownrobot.replay.skeleton import BOXES, Box, Skeleton, box_skeleton, rover_skeleton
from sidm.config import ConfigError, replace
from sidm.drives import POSITION, QUATERNION, Drive, Ground
from sidm.systems import Robot
from sidm.terrain import height_at

#: of robots; colour-blind readers can tell them apart
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
SPACING = 0.1  # m, of the simulated ground
MARGIN = 4.0  # m of ground around the paths
LEVEL_SPACING = 0.5  # m, of level ground
TRUTH_COLOUR = "#F2F2EE"  # of the robot that really drove, beside predictions
GHOST_OPACITY = 0.42
#: wheelbase, track and tyre radius of the paper's robots, m
ROVER_WHEELS = 0.685, 0.360, 0.100
ROVER_JOINTS = 10


class Track(NamedTuple):
    """Motion of one robot at T + 1 moments."""

    name: str
    step: float  # s between two moments
    position: np.ndarray  # (T + 1, 3), m, of the body's frame
    quaternion: np.ndarray  # (T + 1, 4), x, y, z, w, body to world
    joints: np.ndarray  # (T + 1, J), rad; the skeleton's `joint` is a column
    skeleton: Skeleton
    colour: str = COLOURS[0]
    ghost: float = 0.0  # opacity of a translucent robot; 0 for a solid one


class Scene(NamedTuple):
    """Tracks over ground; the first track is the main one."""

    tracks: tuple[Track, ...]
    ground: Ground
    distance: float = 2.4  # m, of the camera
    label: str = ""


def ride_track(
    ride: Ride, name: str = "robot", colour: str = COLOURS[0], ghost: float = 0.0
) -> Track:
    """Track of a simulated ride."""
    return Track(
        name,
        float(ride.times[1]),
        ride.states[:, POSITION],
        ride.states[:, QUATERNION],
        ride.joints,
        rover_skeleton(ride.robot, ride.strut_motors),
        colour,
        ghost,
    )


def rides_scene(rides: Ride | Mapping[str, Ride]) -> Scene:
    """Scene of a ride, or several by name over the first's ground, as ghosts."""
    named = {"robot": rides} if isinstance(rides, Ride) else rides
    tracks = [
        ride_track(ride, name, COLOURS[n % len(COLOURS)], GHOST_OPACITY if n else 0.0)
        for n, (name, ride) in enumerate(named.items())
    ]
    return Scene(tuple(tracks), Ground(next(iter(named.values())).heights, SPACING))


def rolling_angles(
    position: np.ndarray, quaternion: np.ndarray, radius: float, half_track: float = 0.0
) -> np.ndarray:
    """Angles (T + 1, 4), rad, of wheels that roll without slip on a given path.

    The path has positions (T + 1, 3), m, and quaternions (T + 1, 4). The wheels are
    rear right, rear left, front right, front left, `half_track` from the middle: in a
    bend the outer wheels turn faster.
    """
    attitude = Rotation.from_quat(quaternion)
    back = attitude[:-1].inv()  # world to body
    ahead = back.apply(np.diff(position, axis=0))[:, 0]
    turn = (back * attitude[1:]).as_rotvec()[:, 2]
    right, left = ahead + half_track * turn, ahead - half_track * turn
    distance = np.cumsum(np.stack([right, left, right, left], axis=1), axis=0)
    return np.vstack([np.zeros(4), distance]) / radius


def attitudes_on_ground(
    path: np.ndarray, yaw: np.ndarray, ground: Ground, base: float, track: float
) -> Rotation:
    """Attitudes (T + 1) of four wheels on a path (T + 1, 2), m, with a yaw, rad."""
    ahead = np.array([np.cos(yaw), np.sin(yaw)]).T
    left = np.array([-np.sin(yaw), np.cos(yaw)]).T

    def slope(direction: np.ndarray, length: float) -> np.ndarray:
        high, low = (
            height_on(ground, path + sign * length / 2 * direction) for sign in (1, -1)
        )
        return np.arctan((high - low) / length)

    angles = np.stack([yaw, -slope(ahead, base), slope(left, track)], axis=1)
    return Rotation.from_euler("ZYX", angles)


def height_on(ground: Ground, points: np.ndarray) -> np.ndarray:
    """Heights (N,), m, of the ground at points (N, 2), m."""
    x, y = (points - np.array(ground.centre)).T
    return height_at(ground.heights, x, y, ground.spacing)


def wheel_dimensions(shape: Box | Robot) -> tuple[float, float, float]:
    """Wheelbase, track and wheel radius, m."""
    if isinstance(shape, Box):
        return shape.wheelbase, shape.track, shape.radius
    return ROVER_WHEELS


def drive_track(
    drive: Drive, ground: Ground, shape: Box | Robot, name: str, colour: str
) -> Track:
    """Track of a drive on rolling wheels; a planar pose stands on the ground."""
    pose = drive.states[:, : drive.body.pose_size]
    base, track, radius = wheel_dimensions(shape)
    is_planar = drive.body.pose == "planar"
    if is_planar:
        # The frame of a box is on the ground, the frame of a rover above it.
        above = 0.0 if isinstance(shape, Box) else radius
        height = height_on(ground, pose[:, :2]) + above
        position = np.column_stack([pose[:, :2], height])
        attitude = attitudes_on_ground(pose[:, :2], pose[:, 2], ground, base, track)
        quaternion = attitude.as_quat()
    else:
        position, quaternion = pose[:, :3], pose[:, 3:7]
    joints = wheels = rolling_angles(position, quaternion, radius, track / 2)
    if isinstance(shape, Box):
        skeleton = box_skeleton(shape, on_ground=is_planar)
    else:
        skeleton = rover_skeleton(shape)
        joints = np.zeros((len(wheels), ROVER_JOINTS))
        joints[:, 4:8] = wheels
    return Track(
        name, 1 / drive.body.rate, position, quaternion, joints, skeleton, colour
    )


def drive_scene(
    drive: Drive,
    shape: Box | Robot = BOXES["husky"],
    path: np.ndarray | None = None,
    names: tuple[str, str] = ("the robot", "model"),
) -> Scene:
    """Scene of a recorded drive over its ground, or level ground.

    A path has the states (K + 1, S) that a model predicts from the drive's start, as
    `Model.rollout` returns them; a ghost drives there. The names, for the legend, are
    then of robot and model.
    """
    base = wheel_dimensions(shape)[0]
    if drive.ground is None and drive.body.pose_size:  # a map's origin may be far away
        start = np.zeros(drive.states.shape[1])
        start[:2] = drive.states[0, :2]
        drive = replace(drive, states=drive.states - start)
        path = None if path is None else path - start
    if path is None:
        ground = _ground_under([drive])
        track = drive_track(drive, ground, shape, drive.name, COLOURS[0])
        return Scene((track,), ground, 3.5 * base)
    predicted = replace(drive, states=path)
    ground = _ground_under([drive, predicted])
    robot = drive_track(drive, ground, shape, names[0], TRUTH_COLOUR)
    ghost = drive_track(predicted, ground, shape, names[1], COLOURS[1])
    tracks = robot, ghost._replace(ghost=GHOST_OPACITY)
    return Scene(tracks, ground, 4.5 * base, f"{names[0]} and {names[1]}")


def _ground_under(drives: Sequence[Drive]) -> Ground:
    """The recorded ground of the first drive, or level ground under all drives."""
    body, recorded = drives[0].body, drives[0].ground
    if body.pose == "none":
        raise ConfigError(
            f"body '{body.name}' has no pose; a replay needs pose: planar or spatial"
        )
    if recorded:
        # Positions are relative to the middle of a recorded ground.
        return Ground(recorded.heights, recorded.spacing)
    points = np.concatenate([drive.states[:, :2] for drive in drives])
    low, high = points.min(0) - 2 * MARGIN, points.max(0) + 2 * MARGIN
    x, y = (low + high) / 2
    columns, rows = np.ceil((high - low) / LEVEL_SPACING).astype(int) + 1
    return Ground(np.zeros((rows, columns)), LEVEL_SPACING, (float(x), float(y)))
