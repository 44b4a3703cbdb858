"""Rides: one robot over one ground, with the motion of all its parts."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np

from sidm.config import unknown_name
from sidm.drives import CONTROL_STEP, QUATERNION, tilt_of
from sidm.systems import FREE_PHYSICS, ROLES, SYSTEMS, Physics, Robot, Terrain
from sidm.terrain import generate_terrain

#: The robots of all systems, by the names in the explorer's menus.
ROBOTS = {
    f"{system.name} {role}": system.robot(role)
    for system in SYSTEMS.values()
    for role in ROLES
}

#: Order of `Ride.struts`.
STRUTS = ("rear right", "rear left", "front right", "front left")

SAMPLES_PER_STEP = 2  # moments recorded in a control step
SAMPLE_TIME = CONTROL_STEP / SAMPLES_PER_STEP  # s between two moments
WEAVE = 0.6  # amplitude of the steering, of full steering
WEAVE_PERIOD = 2.0  # s from one bend to the right to the next


def find_robot(name: str) -> Robot:
    """The robot with this name, such as 'system1 novice', of a system in SYSTEMS."""
    system, _, role = name.rpartition(" ")
    if system not in SYSTEMS or role not in ROLES:
        raise unknown_name(name, ROBOTS, kind="robot")
    return SYSTEMS[system].robot(role)


class Ride(NamedTuple):
    """Motion of one robot on one ground at T + 1 moments, 0.05 s apart."""

    robot: Robot
    heights: np.ndarray  # (H, W), m, of the ground
    times: np.ndarray  # (T + 1,), s
    states: np.ndarray  # (T + 1, 13)
    struts: np.ndarray  # (T + 1, 4), m, order of STRUTS, compression positive
    joints: np.ndarray  # (T + 1, 10), rad, order of `Simulator.joint_angles`
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
    """Simulate a robot that drives from the origin, first heading along x.

    Throttle and steering are in [-1, 1], steering positive to the right; each is one
    number for all control steps of 0.1 s or one for each, (steps,). The ride has two
    moments a step. Motors brake the struts, as in the recorded robot, or springs and
    dampers act alone.
    """
    from sidm.simulation import Simulator

    heights = generate_terrain(terrain, terrain_seed)
    with Simulator(robot, heights, sampled_physics(strut_motors)) as simulator:
        return drive(simulator, throttle, steering, steps)


def sampled_physics(strut_motors: bool) -> Physics:
    """Physics with steps of half a control step; the motion stays bit for bit."""
    physics = Physics() if strut_motors else FREE_PHYSICS
    steps = physics.steps_per_control // SAMPLES_PER_STEP
    return dataclasses.replace(physics, steps_per_control=steps)


def weave(steps: int = 40) -> np.ndarray:
    """Steering (steps,) that swings to the right and to the left as a sine."""
    return WEAVE * np.sin(2 * np.pi * CONTROL_STEP * np.arange(steps) / WEAVE_PERIOD)


def drive(
    simulator: Any,
    throttle: float | np.ndarray,
    steering: float | np.ndarray = 0.0,
    steps: int = 40,
    yaw: float = 0.0,
) -> Ride:
    """Reset a simulator with `sampled_physics` to a yaw, rad, and record a ride."""
    pairs = np.broadcast_arrays(np.broadcast_to(throttle, (steps,)), steering)
    actions = np.repeat(np.stack(pairs, axis=1), SAMPLES_PER_STEP, axis=0)
    moments = []
    for action in [None, *actions]:
        state = simulator.reset(yaw=yaw) if action is None else simulator.step(action)
        moments.append((state, simulator.strut_positions, simulator.joint_angles))
    states, struts, joints = map(np.array, zip(*moments, strict=True))
    return Ride(
        simulator.robot,
        simulator.heights,
        SAMPLE_TIME * np.arange(len(states)),
        states,
        struts,
        joints,
        simulator.physics.strut_motors,
    )


def tilt(states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pitch and roll over time, degrees, each (..., T), of states (..., T, 13).

    Pitch is positive with the nose down, roll with the right side down. Where a robot
    turns over, the roll goes on beyond 180 degrees.
    """
    pitch, roll = tilt_of(states[..., QUATERNION])
    return np.degrees(pitch), np.degrees(np.unwrap(roll))
