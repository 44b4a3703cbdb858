"""The linkage against closed loops, and the heave against values of the robot.

In heave all four struts move alike, by q. Each axle then turns about a line of the
chassis, so every part's velocity is its own constant times dq/dt, and the motion has
one mass, one spring (four struts), one damper. The constants are those of the closed
linkage at q, not of the two joints that stand for it in the simulator. All struts of
the robots are free (`strut_motors=False`), and Bullet's drag on links is off: neither
belongs to the suspension.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sidm.simulation import Simulator
from sidm.simulation import dimensions as figures
from sidm.simulation.dimensions import AXLES, REAR_LEFT_RODS
from sidm.simulation.linkage import axle_joints, axle_pose, rods, twists
from sidm.simulation.robot import LINKAGE_MASS
from sidm.simulation.suspension import BRAKE_LIMIT, BRAKED, FREE, Suspension
from sidm.systems import ROLES, SYSTEMS, Physics

ROBOTS = {
    f"{name} {role}": system.robot(role)
    for name, system in SYSTEMS.items()
    for role in ROLES
}
FLAT = np.zeros((300, 300))
#: m from the origin: here the robot comes to rest; at the origin it trembles by a tenth
#: of its sag because of rounding
ASIDE = 0.25


def heave(travel):
    """Pose, turn (3,), rad, and shift (3,) of the rear axle a metre of q."""
    pose = axle_pose("rear", (travel, travel))
    twist = twists("rear", pose).sum(axis=0)
    return pose, twist[:3], twist[3:]


def velocities(robot, travel):
    """Mass, velocity (3,), inertia and turn about y of each part of the rear axle.

    Velocity and turn are by unit of dq/dt. The motor holds a tyre, so it turns with the
    axle; links and struts are one part of the model.
    """
    pose, turn, shift = heave(travel)
    parts = [
        (figures.AXLE_MASS, figures.REAR_AXLE, 0.0),
        (LINKAGE_MASS, figures.REAR_LEFT_RODS.mean(axis=(0, 1)) * (1, 0, 1), 0.0),
    ]
    for side in figures.SIDES:
        signs, inertia = figures.mirror("rear", side), figures.TYRE_INERTIA[1]
        parts.append((figures.HUB_MASS, signs * figures.REAR_LEFT_HUB, 0.0))
        parts.append((figures.TYRE_MASS, signs * figures.REAR_LEFT_TYRE, inertia))
    for mass, place, inertia in parts:
        velocity, scale = shift + np.cross(turn, pose.place(place)), robot.mass_scale
        yield scale * mass, velocity, scale * inertia, turn[1]


def computed_pole(robot, travel, dt):
    """Decay rate and angular frequency, 1/s, of q in free fall.

    The chassis then moves so that the momentum stays zero. They are those of
    velocity-first Euler steps of `dt`. With ever smaller steps they become those of the
    roots of m s^2 + 4 c s + 4 k.
    """
    parts = list(velocities(robot, travel))
    inertia_of_q = 2 * sum(m * v @ v + inertia * w * w for m, v, inertia, w in parts)
    momentum = 2 * sum(m * v[2] for m, v, *_ in parts)
    total = figures.CHASSIS_MASS + 2 * sum(m for m, *_ in parts)
    mass = inertia_of_q - momentum**2 / total
    k, c = 4 * robot.spring / mass * dt**2, 4 * robot.damping / mass * dt
    return pole([1, k + c - 2, 1 - c], dt)


def measured_pole(travel, dt):
    """Decay rate and angular frequency, 1/s, of a recorded travel (T,).

    A linear recursion of second order is fitted to the travel.
    """
    rows = np.stack([travel[1:-1], travel[:-2], np.ones(len(travel) - 2)], axis=1)
    a, b, _ = np.linalg.lstsq(rows, travel[2:], rcond=None)[0]
    return pole([1, -a, -b], dt)


def pole(recursion, dt):
    """Decay rate and angular frequency, 1/s, of a recursion's oscillation."""
    root = max(np.roots(recursion).astype(complex), key=lambda z: z.imag)
    return -np.log(root).real / dt, np.log(root).imag / dt


@pytest.mark.parametrize("name", ROBOTS)
def test_frequency_and_damping_of_heave_in_free_fall(name):
    # clear of the stops
    robot = ROBOTS[name].replace(
        spring_offset=-0.002, travel_lower=-0.02, travel_upper=0.002
    )
    physics = Physics(
        strut_motors=False,
        damping=0.0,
        drop_height=200.0,
        settling_time=0.0,
        steps_per_control=1,
        solver_iterations=200,
    )
    with Simulator(robot, FLAT, physics) as simulator:
        simulator.reset()
        travel = []
        for _ in range(1500 if robot.spring < 1000 else 60):
            simulator.step(np.zeros(2))
            travel.append(simulator.strut_positions)
    assert np.ptp(travel, axis=1).max() < 0.02 * np.ptp(travel)  # all four move alike
    dt, expected = physics.time_step, robot.spring_offset
    decay, frequency = measured_pole(np.mean(travel, axis=1), dt)
    expected_decay, expected_frequency = computed_pole(robot, expected, dt)
    assert frequency == pytest.approx(expected_frequency, rel=0.1)
    assert decay / np.hypot(decay, frequency) == pytest.approx(
        expected_decay / np.hypot(expected_decay, expected_frequency), rel=0.1
    )


@pytest.mark.parametrize("name", ROBOTS)
def test_static_sag_is_the_sprung_weight_on_four_struts_or_the_stop(name):
    # tyres slide, so that no friction holds the axles
    robot = ROBOTS[name].replace(friction=0.0)
    physics = Physics(strut_motors=False, settling_time=2.0)
    with Simulator(robot, FLAT, physics) as simulator:
        simulator.reset(ASIDE)
        sag = simulator.strut_positions
    # With the tyres on the ground, raising the chassis by z turns the axles:
    # q = -z / (rise of the tyre a metre of q).
    pose, turn, shift = heave(sag.mean())
    rise = (shift + np.cross(turn, pose.place(figures.REAR_LEFT_TYRE)))[2]
    parts = velocities(robot, sag.mean())
    unsprung = sum(2 * mass * (rise - velocity[2]) for mass, velocity, *_ in parts)
    weight = physics.gravity * (figures.CHASSIS_MASS * rise + unsprung)
    free = robot.spring_offset + weight / (4 * robot.spring)
    expected = min(free, robot.travel_upper)
    deflection = abs(expected - robot.spring_offset)
    assert sag.mean() == pytest.approx(expected, abs=0.1 * deflection)
    assert np.ptp(sag) < 0.12 * deflection


def held_at(suspension, roll, steps):
    """Torques after `steps` with the axle held at a roll, rad, and at no heave."""
    for _ in range(steps):
        torques = suspension.torques(suspension.joints.heave_angle(0.0), 0.0, roll, 0.0)
    return torques


def test_links_and_struts_are_springs_in_series_in_roll():
    # clear of the stops
    robot = ROBOTS["system2 novice"].replace(travel_lower=-0.02, travel_upper=0.02)
    suspension = Suspension(robot, "front", Physics(strut_motors=False))
    rate = suspension.joints.roll_rate(0.0)
    struts = 2 * robot.spring / rate**2  # N m/rad
    both = 1 / (1 / FREE.link_stiffness + 1 / struts)
    assert held_at(suspension, 0.1, 400)[1] == pytest.approx(-0.1 * both, rel=1e-3)
    right, left = suspension.travel(suspension.joints.heave_angle(0.0))
    slip = 0.1 * both / struts
    assert (left - right) / 2 * rate == pytest.approx(slip, rel=1e-3)


def test_a_strut_at_its_stop_lifts_the_axle_away_and_leaves_the_links_to_give():
    robot = ROBOTS["system1 novice"]  # the upper stop is at zero travel
    suspension, level = (Suspension(robot, "front", Physics()) for _ in range(2))
    heave, roll = held_at(suspension, 0.1, 400)
    assert suspension.slip == pytest.approx(0.0, abs=1e-12)
    assert roll == pytest.approx(-0.1 * BRAKED["front"].link_stiffness, rel=1e-3)
    lift = 100 * suspension.joints.heave_travel[1]
    assert heave < held_at(level, 0.0, 1)[0] - lift


def test_a_braked_rear_axle_creeps_and_yields_at_the_brakes_limit():
    robot = ROBOTS["system2 expert"]
    creeping, yielding = (Suspension(robot, "rear", Physics()) for _ in range(2))
    stiffness = robot.mass_scale * BRAKED["rear"].link_stiffness
    torque = -held_at(creeping, 10 / stiffness, 50)[1]
    assert 0.9 * 10 < torque < 10  # N m; a tenth of a second costs little
    right, left = creeping.travel(0.0)
    assert left == 0 > right  # one strut extends
    limit = 2 * BRAKE_LIMIT / creeping.joints.roll_rate(0.0)
    assert -held_at(yielding, 60 / stiffness, 50)[1] == pytest.approx(limit, rel=0.05)


def tyres(axle):
    """Centres (2, 3) of an axle's tyres with both struts at zero."""
    left = figures.REAR_LEFT_TYRE
    return np.stack([figures.mirror(axle, side) * left for side in figures.SIDES])


def by_joints(joints, travel, points):
    """Points (n, 3) of the axle by the two joints in series.

    `travel` is that of the struts (right, left), m.
    """
    right, left = travel
    middle, points = (left + right) / 2, joints.pose.place(points)
    roll = joints.roll_rate(middle) * (left - right) / 2
    for axis, point, angle in [
        (joints.roll_axis, joints.roll_point, roll),
        (joints.heave_axis, joints.heave_point, joints.heave_angle(middle)),
    ]:
        points = Rotation.from_rotvec(angle * axis).apply(points - point) + point
    return points


def test_a_pose_keeps_the_links_and_shortens_the_struts():
    for axle, travel in [("rear", (-0.02, -0.003)), ("front", (0.0, -0.015))]:
        ends, pose = rods(axle), axle_pose(axle, travel)
        length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
        moved = np.linalg.norm(pose.place(ends[:, 0]) - ends[:, 1], axis=1)
        assert length - moved == pytest.approx([0, 0, 0, 0, *travel], abs=1e-10)


def test_travel_that_no_link_allows_is_refused(monkeypatch):
    with pytest.raises(ValueError, match="rear axle cannot reach .* 0.5 and 0.5 m"):
        axle_pose("rear", (0.5, 0.5))
    with pytest.raises(ValueError, match="-0.06 to 0.02 m, not -0.1 to 0.0"):
        axle_joints("front", -0.1, 0.0)
    # with all rods in one plane nothing holds sideways: the equations are singular
    flat = REAR_LEFT_RODS * (1, 0, 1)
    monkeypatch.setattr("sidm.simulation.linkage.REAR_LEFT_RODS", flat)
    with pytest.raises(ValueError, match="front axle cannot reach"):
        axle_pose("front", (-0.01, 0.0))


@pytest.mark.parametrize("axle", AXLES)
def test_twists_are_the_derivatives_of_the_pose(axle):
    points, travel, small = rods(axle)[:, 0], np.array([-0.004, -0.009]), 1e-6
    pose = axle_pose(axle, travel)
    for twist, step in zip(twists(axle, pose), small * np.eye(2), strict=True):
        ahead, behind = (axle_pose(axle, travel + one) for one in (step, -step))
        moved = (ahead.place(points) - behind.place(points)) / (2 * small)
        turned = np.cross(twist[:3], pose.place(points)) + twist[3:]
        assert moved == pytest.approx(turned, abs=1e-5)


def test_lines_and_rates_are_the_stated_ones():
    # stated figures of the robot: heave about (0.2158, 0, 0.0635) with 0.2032 m/rad,
    # roll along (0.9746, 0, 0.2238) with 0.0273 m/rad
    joints = axle_joints("rear", 0.0, 0.0)
    assert joints.heave_point == pytest.approx((0.2158, 0, 0.0635), abs=1e-4)
    assert joints.heave_axis == pytest.approx((0, 1, 0), abs=1e-9)
    assert joints.roll_axis == pytest.approx((0.9746, 0, 0.2238), abs=1e-4)
    assert joints.heave_travel[1] == pytest.approx(0.2032, rel=2e-3)
    assert 1 / joints.roll_rate(0.0) == pytest.approx(0.0273, rel=2e-3)


@pytest.mark.parametrize("limits", [(-0.02, 0.0), (-0.01, 0.003)])
@pytest.mark.parametrize("axle", AXLES)
def test_wheels_stay_within_3_millimetres_of_the_closed_linkage(axle, limits):
    """The bound holds over the whole travel."""
    joints, wheels = axle_joints(axle, *limits), tyres(axle)
    for right in np.linspace(*limits, 5):
        for left in np.linspace(*limits, 5):
            exact = axle_pose(axle, (right, left)).place(wheels)
            off = by_joints(joints, (right, left), wheels) - exact
            assert np.linalg.norm(off, axis=1).max() < 0.003


@pytest.mark.parametrize("motors", [True, False])
def test_with_struts_at_zero_the_tyres_are_where_the_figures_have_them(motors):
    physics = Physics(strut_motors=motors)
    with Simulator(ROBOTS["system1 expert"], FLAT, physics) as simulator:
        links = simulator._client.getLinkStates(
            simulator._body, simulator._wheels, computeForwardKinematics=1
        )
        assert simulator.strut_positions == pytest.approx(np.zeros(4), abs=1e-6)
    expected = np.concatenate([tyres(axle) for axle in AXLES])
    places = np.array([link[4] for link in links])
    assert places == pytest.approx(expected, abs=1e-3)  # exact at mid-travel
