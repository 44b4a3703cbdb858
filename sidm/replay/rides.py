"""Rides: one robot over one ground, with all that moves of it: body, struts, axles, wheels, kingpins."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np

from sidm.config import unknown_name
from sidm.drives import CONTROL_STEP, QUATERNION, tilt_of
from sidm.systems import FREE_PHYSICS, ROLES, SYSTEMS, Physics, Robot, Terrain
from sidm.terrain import generate_terrain

#: The robots of all systems, by the names the explorer's menus show.
ROBOTS = {
    f"{system.name} {role}": system.robot(role)
    for system in SYSTEMS.values()
    for role in ROLES
}

#: Order of `Ride.struts`.
STRUTS = ("rear right", "rear left", "front right", "front left")

SAMPLES = 2  # moments that are kept of a control step
SAMPLE = CONTROL_STEP / SAMPLES  # s between them
#: of full steering; s from one bend to the right to the next
WEAVE, WEAVE_PERIOD = 0.6, 2.0


def find_robot(name: str) -> Robot:
    """The robot of that name, as 'system1 novice'; ConfigError naming the nearest otherwise."""
    if name not in ROBOTS:
        raise unknown_name(name, ROBOTS, "the robots")
    return ROBOTS[name]


class Ride(NamedTuple):
    """One robot on one ground, every 0.05 s; T + 1 moments."""

    robot: Robot
    heights: np.ndarray  # (H, W), m, of the ground
    times: np.ndarray  # (T + 1,), s
    states: np.ndarray  # (T + 1, 13)
    struts: np.ndarray  # (T + 1, 4), m, as in STRUTS, compression positive
    joints: np.ndarray  # (T + 1, 10), rad, as `Simulator.joint_angles`
    #: whether the struts were braked, which decides how the axles hang
    strut_motors: bool = True


def ride(
    robot: Robot,
    terrain: Terrain,
    terrain_seed: int = 0,
    throttle: float | np.ndarray = 0.5,
    steering: float | np.ndarray = 0.0,
    steps: int = 40,
    strut_motors: bool = True,
) -> Ride:
    """Drive a robot from the origin, heading along x.

    Args:
        robot: its parameters.
        terrain: the kind of ground.
        terrain_seed: which ground.
        throttle: in [-1, 1], held, or one a control step, (steps,).
        steering: in [-1, 1], positive to the right, held, or one a control step,
            (steps,).
        steps: control steps of 0.1 s.
        strut_motors: brake the struts as in the recorded robot; otherwise springs and
            dampers act alone.
    """
    from sidm.simulation import Simulator

    with Simulator(
        robot, generate_terrain(terrain, terrain_seed), sampled_physics(strut_motors)
    ) as simulator:
        return drive(simulator, throttle, steering, steps)


def sampled_physics(strut_motors: bool) -> Physics:
    """The robots' physics, to be looked at twice a control step; the motion is the same, bit for bit."""
    whole = Physics() if strut_motors else FREE_PHYSICS
    return dataclasses.replace(
        whole, steps_per_control=whole.steps_per_control // SAMPLES
    )


def weave(steps: int = 40) -> np.ndarray:
    """Steering (steps,) to the right, then to the left, and again."""
    return WEAVE * np.sin(2 * np.pi * CONTROL_STEP * np.arange(steps) / WEAVE_PERIOD)


def drive(
    simulator: Any,
    throttle: float | np.ndarray,
    steering: float | np.ndarray = 0.0,
    steps: int = 40,
    yaw: float = 0.0,
) -> Ride:
    """A ride in a `Simulator` of `sampled_physics` that stands ready; it is reset first, heading `yaw`, rad."""
    actions = np.stack(
        np.broadcast_arrays(np.broadcast_to(throttle, (steps,)), steering), axis=1
    )
    moments = [
        (simulator.reset(yaw=yaw), simulator.strut_positions, simulator.joint_angles)
    ]
    for action in np.repeat(actions, SAMPLES, axis=0):
        moments.append(
            (simulator.step(action), simulator.strut_positions, simulator.joint_angles)
        )
    states, struts, joints = map(np.array, zip(*moments, strict=True))
    times = SAMPLE * np.arange(len(states))
    return Ride(
        simulator.robot,
        simulator.heights,
        times,
        states,
        struts,
        joints,
        simulator.physics.strut_motors,
    )


def tilt(states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pitch (nose down positive) and roll (right side down positive), degrees, each (...,), of states (..., 13)."""
    pitch, roll = tilt_of(states[..., QUATERNION])
    return np.degrees(pitch), np.degrees(roll)
