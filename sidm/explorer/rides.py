"""Rides: one robot under a held action over one ground, with what its struts do."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sidm.config import unknown_name
from sidm.systems import ROLES, SYSTEMS, Physics, Robot, Terrain
from sidm.terrain import generate_terrain
from sidm.trajectory import QUATERNION

#: The robots of all systems, by the names the explorer's menus show.
ROBOTS = {f"{system.name} {role}": system.robot(role) for system in SYSTEMS.values() for role in ROLES}

#: Order of `Ride.struts`.
STRUTS = ("rear right", "rear left", "front right", "front left")


def find_robot(name: str) -> Robot:
    """The robot of that name, as 'system1 novice'; ConfigError naming the nearest otherwise."""
    if name not in ROBOTS:
        raise unknown_name(name, ROBOTS, "the robots")
    return ROBOTS[name]


class Ride(NamedTuple):
    """T control steps of one robot under a held action."""

    robot: Robot
    heights: np.ndarray  # (H, W), m, of the ground
    states: np.ndarray  # (T + 1, 13)
    struts: np.ndarray  # (T + 1, 4), m, as in STRUTS, compression positive


def ride(
    robot: Robot,
    terrain: Terrain,
    terrain_seed: int = 0,
    throttle: float = 0.5,
    steering: float = 0.0,
    steps: int = 40,
    strut_motors: bool = True,
) -> Ride:
    """Drive a robot from the origin along x.

    Args:
        robot: its parameters.
        terrain: the kind of ground.
        terrain_seed: which ground.
        throttle: held, in [-1, 1].
        steering: held, in [-1, 1].
        steps: control steps of 0.1 s.
        strut_motors: brake the struts as in the recorded robot; otherwise springs and dampers act alone.
    """
    from sidm.simulation import Simulator

    physics = Physics(strut_motors=strut_motors)
    with Simulator(robot, generate_terrain(terrain, terrain_seed), physics) as simulator:
        return drive(simulator, throttle, steering, steps)


def drive(simulator: Any, throttle: float, steering: float = 0.0, steps: int = 40) -> Ride:
    """A ride in a `Simulator` that stands ready; it is reset first."""
    states, struts = [simulator.reset()], [simulator.strut_positions]
    for _ in range(steps):
        states.append(simulator.step(np.array([throttle, steering])))
        struts.append(simulator.strut_positions)
    return Ride(simulator.robot, simulator.heights, np.array(states), np.array(struts))


def tilt(states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pitch (nose down positive) and roll (right side down positive), degrees, each (...,), of states (..., 13)."""
    x, y, z, w = np.moveaxis(states[..., QUATERNION], -1, 0)
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    return np.degrees(pitch), np.degrees(roll)
