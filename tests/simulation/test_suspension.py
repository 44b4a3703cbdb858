"""The suspension's truth: sag, frequency and damping of the heave against values computed from the robot's figures.

In heave all four struts move alike, by q. Each axle then turns about a fixed line of the chassis, so every part's
velocity is its own constant times dq/dt, and the motion has one mass, one spring (four struts), one damper. The robots
are taken with all struts free (`rear_strut_hold=0`) and without Bullet's drag on links, neither being the suspension's.
"""

import numpy as np
import pytest

from sidm.simulation import Simulator
from sidm.simulation import robot as figures
from sidm.systems import ROLES, SYSTEMS, Physics

ROBOTS = {f"{name} {role}": system.robot(role) for name, system in SYSTEMS.items() for role in ROLES}
FLAT = np.zeros((300, 300))


def heave(sides=figures.SIDES):
    """How the rear axle moves against the chassis a metre of travel of these struts: turn (3,), rad, and shift (3,)."""
    joints = [figures.strut_joints("rear")[side] for side in sides]
    turn = sum(joint.rate * joint.axis for joint in joints)
    shift = sum(joint.rate * np.cross(joint.point, joint.axis) for joint in joints)
    return turn, shift


def velocities(robot):
    """Of each part of the rear axle, a unit of dq/dt: mass, velocity (3,) and, about y, inertia and turn."""
    scale, (turn, shift) = robot.mass_scale, heave()
    for side in figures.SIDES:
        signs = figures.mirror("rear", side)
        hub, tyre = signs * figures.REAR_LEFT_HUB, signs * figures.REAR_LEFT_TYRE
        yield scale * figures.HUB_MASS, shift + np.cross(turn, hub), 0.0, turn[1]
        # held by its motor, the tyre turns with the axle
        yield scale * figures.TYRE_MASS, shift + np.cross(turn, tyre), scale * figures.TYRE_INERTIA[1], turn[1]
    yield scale * figures.AXLE_MASS, shift + np.cross(turn, figures.REAR_AXLE), 0.0, turn[1]
    # Links and struts, in the model one part in their middle that moves with one strut of the two: with half the heave.
    first_turn, first_shift = heave(figures.SIDES[:1])
    middle = figures.REAR_LEFT_RODS.mean(axis=(0, 1)) * (1, 0, 1)
    yield scale * figures.LINKAGE_MASS, first_shift + np.cross(first_turn, middle), 0.0, first_turn[1]


def falling_mass(robot):
    """The mass, kg, that goes with q in free fall, where the chassis gives way so that momentum stays nought."""
    parts = list(velocities(robot))
    own = 2 * sum(mass * v @ v + inertia * w * w for mass, v, inertia, w in parts)
    momentum = 2 * sum(mass * v[2] for mass, v, *_ in parts)
    return own - momentum**2 / (figures.CHASSIS_MASS + 2 * sum(mass for mass, *_ in parts))


def computed_pole(robot, dt):
    """The decay rate and angular frequency, 1/s, of q in free fall, as velocity-first Euler steps of `dt` have them.

    With ever smaller steps they become those of the roots of m s^2 + 4 c s + 4 k.
    """
    mass = falling_mass(robot)
    k, c = 4 * robot.spring / mass * dt**2, 4 * robot.damping / mass * dt
    root = max(np.roots([1, k + c - 2, 1 - c]).astype(complex), key=lambda z: z.imag)
    pole = np.log(root) / dt
    return -pole.real, pole.imag


def measured_pole(travel, dt):
    """The same of a recorded travel (T,), by the linear recursion of second order that fits it best."""
    rows = np.stack([travel[1:-1], travel[:-2], np.ones(len(travel) - 2)], axis=1)
    a, b, _ = np.linalg.lstsq(rows, travel[2:], rcond=None)[0]
    pole = np.log(max(np.roots([1, -a, -b]).astype(complex), key=lambda z: z.imag)) / dt
    return -pole.real, pole.imag


@pytest.mark.parametrize("name", ROBOTS)
def test_frequency_and_damping_of_heave_in_free_fall(name):
    robot = ROBOTS[name].replace(spring_offset=-0.002, travel_lower=-0.02, travel_upper=0.002)  # clear of the stops
    physics = Physics(
        rear_strut_hold=0.0, damping=0.0, drop_height=200.0, settling_time=0.0, steps_per_control=1,
        solver_iterations=200,
    )  # fmt: skip
    with Simulator(robot, FLAT, physics) as simulator:
        simulator.reset()
        travel = []
        for _ in range(1500 if robot.spring < 1000 else 60):
            simulator.step(np.zeros(2))
            travel.append(simulator.strut_positions)
    assert np.ptp(travel, axis=1).max() < 0.15 * np.ptp(travel)  # nearly alike: links hang on the right struts alone
    decay, frequency = measured_pole(np.mean(travel, axis=1), physics.time_step)
    expected_decay, expected_frequency = computed_pole(robot, physics.time_step)
    assert frequency == pytest.approx(expected_frequency, rel=0.1)
    assert decay / np.hypot(decay, frequency) == pytest.approx(
        expected_decay / np.hypot(expected_decay, expected_frequency), rel=0.1
    )


@pytest.mark.parametrize("name", ROBOTS)
def test_static_sag_is_the_sprung_weight_on_four_struts_or_the_stop(name):
    robot = ROBOTS[name].replace(friction=0.0)  # tyres that slide, so that no friction holds the axles
    physics = Physics(rear_strut_hold=0.0, settling_time=2.0)
    with Simulator(robot, FLAT, physics) as simulator:
        simulator.reset()
        sag = simulator.strut_positions
    # With the tyres on the ground, raising the chassis by z turns the axles: q = -z / (tyre's rise a metre of q).
    turn, shift = heave()
    rise = (shift + np.cross(turn, figures.REAR_LEFT_TYRE))[2]
    weight = figures.CHASSIS_MASS * rise
    for mass, v, *_ in velocities(robot):
        weight += 2 * mass * (rise - v[2])
    expected = min(robot.spring_offset + physics.gravity * weight / (4 * robot.spring), robot.travel_upper)
    deflection = abs(expected - robot.spring_offset)
    assert sag.mean() == pytest.approx(expected, abs=0.1 * deflection)
    assert np.ptp(sag) < 0.25 * deflection
