"""Forces of an axle's struts and links: springs, dampers, stops, brakes, elastic links.

In the released simulator two effects come on top of spring and damper, neither of them
intended. First, Bullet gives every joint a velocity motor. Those of the struts were
never switched off, so they brake each strut with up to 500 N. Second, the links are
closed by constraints, and 300 solver iterations do not solve these completely.

The consequences are: the rear axle, which the solver treats first, is held and only
creeps slowly; the front axle gives way like a viscous damper, in heave and more easily
in roll; and both axles roll elastically because their links yield.

`BRAKED` has these laws as measured on the closed mechanism, which was rebuilt from its
points. The measurements are responses in free space to steps of force and of roll
torque, and the rear axle's roll under the forces of its wheels.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sidm.simulation.linkage import AxleJoints, axle_joints
from sidm.systems import Physics, Robot

#: N, load of a strut at which the closed mechanism yields; the motors have 500 N
BRAKE_LIMIT = 550.0
#: m, both stops share the force where the distances to them differ by less than this
STOP_BLEND = 0.004


class Brake(NamedTuple):
    """The motion of a braked axle; stiffness and damping times the mass scale."""

    #: share of the spring's and damper's force that acts in heave; 0: no heave at all
    heave_share: float
    heave_damping: float  # N s/m, of each strut in heave
    roll_damping: float  # N m s/rad, of the struts in roll; a large value: slow creep
    link_stiffness: float  # N m/rad, of the links in roll, in series with the struts
    link_damping: float = 2.0  # N m s/rad, of the links in roll
    #: direction, and point, m, of the line that the axle rolls about; None: as computed
    #: from the links
    roll_line: tuple[tuple[float, ...], tuple[float, ...]] | None = None


BRAKED = {
    # A joint holds the rear axle at its lower right link, and constraints hold it at
    # the others, so it rolls about another line than its links give.
    "rear": Brake(
        heave_share=0.0,
        heave_damping=0.0,
        roll_damping=150.0,
        link_stiffness=85.0,
        roll_line=((1.0, 0.07, 0.27), (-0.3427, -0.005, 0.030)),
    ),
    "front": Brake(
        heave_share=0.49, heave_damping=1050.0, roll_damping=2.2, link_stiffness=105.0
    ),
}
#: Struts without brakes. More damping of the links was unstable here in steps of 2 ms:
#: it acts explicitly on the chassis, whose moment of inertia is 0.003 kg m^2, and
#: robots with 1.5 times the mass jumped from their stops.
FREE = Brake(
    heave_share=1.0,
    heave_damping=0.0,
    roll_damping=0.0,
    link_stiffness=105.0,
    link_damping=0.5,
)


class Suspension:
    """The struts of a robot's 'rear' or 'front' axle.

    Attributes:
        slip: half the difference of the struts' travels, left minus right, m. The
            elastic links connect it to the axle's roll. It has no mass, so it is a
            state here and not in Bullet.
        heave_free: whether the axle moves in heave at all.
        joints: the axle's heave and roll joint.
    """

    def __init__(self, robot: Robot, axle: str, physics: Physics) -> None:
        law = BRAKED[axle] if physics.strut_motors else FREE
        self.robot, self.slip, self._dt = robot, 0.0, physics.time_step
        self.heave_free = law.heave_share > 0
        stops = (
            (robot.travel_lower, robot.travel_upper) if self.heave_free else (0.0, 0.0)
        )
        self.joints: AxleJoints = axle_joints(axle, *stops)
        if law.roll_line:
            direction, point = map(np.array, law.roll_line)
            self.joints = self.joints._replace(
                roll_axis=direction / np.linalg.norm(direction), roll_point=point
            )
        scale = robot.mass_scale
        self._heave_spring = law.heave_share * robot.spring
        damping = law.heave_share * robot.damping + scale * law.heave_damping
        self._heave_damping = damping
        # from rad to m of slip and from torque to the force of each strut, in N/m and
        # N s/m: the torque is 2 x force / roll rate
        per_strut = scale * self.joints.roll_rate(0.0) ** 2 / 2
        self._brake = per_strut * law.roll_damping
        self._link_stiffness = per_strut * law.link_stiffness
        self._link_damping = per_strut * law.link_damping

    def travel(self, heave_angle: float) -> tuple[float, float]:
        """Travel of the right and the left strut, m, at a heave angle, rad.

        On an axle without heave one strut stays at zero and the other one extends.
        """
        if not self.heave_free:
            return -2 * max(self.slip, 0.0), 2 * min(self.slip, 0.0)
        middle = self.joints.mean_travel(heave_angle)
        return middle - self.slip, middle + self.slip

    def torques(
        self,
        heave_angle: float,
        heave_speed: float,
        roll_angle: float,
        roll_speed: float,
    ) -> tuple[float, float]:
        """Torques, N m, on heave and roll joint for the coming physics step.

        Angles are in rad, speeds in rad/s. The slip moves on by that step.
        """
        robot, joints = self.robot, self.joints
        middle = joints.mean_travel(heave_angle)
        rate, growth = joints.roll_rate(middle), joints.roll_rates[0]  # rad/m, rad/m^2
        above, below = robot.travel_upper - middle, middle - robot.travel_lower
        slip_limit = max(min(above, below), 0.0) if self.heave_free else below / 2
        roll = roll_angle / rate
        link_force, stop_force = self._move_slip(roll, roll_speed / rate, slip_limit)

        a, b, _ = joints.heave_travel
        lever = 2 * a * heave_angle + b  # m/rad
        force = 2 * self._heave_spring * (robot.spring_offset - middle)
        force -= 2 * self._heave_damping * lever * heave_speed
        force += min(max((above - below) / STOP_BLEND, -1.0), 1.0) * stop_force
        # the links pull the axle to the heave where the same roll needs less slip
        force += 2 * link_force * roll * growth / rate
        return force * lever, -2 * link_force / rate

    def _move_slip(
        self, roll: float, speed: float, slip_limit: float
    ) -> tuple[float, float]:
        """Move the slip by one physics step; forces of links and of stop on a strut, N.

        The step is implicit: afterwards the force of the links equals the sum of
        spring, damper, brake and stop. Roll and speed of the axle are in m and m/s of
        slip; `slip_limit`, m, is how far the slip can go until a strut meets its stop.
        """
        spring, damping, dt = self.robot.spring, self.robot.damping, self._dt
        stiffness, link_damping = self._link_stiffness, self._link_damping
        link_force = stiffness * (roll - self.slip) + link_damping * speed
        force = link_force - spring * self.slip
        resistance = damping + link_damping + (stiffness + spring) * dt
        slip_rate = force / (resistance + self._brake)  # m/s
        if self._brake * abs(slip_rate) > BRAKE_LIMIT:
            slip_rate = (force - math.copysign(BRAKE_LIMIT, force)) / resistance
        slip = min(max(self.slip + slip_rate * dt, -slip_limit), slip_limit)
        slip_rate, self.slip = (slip - self.slip) / dt, slip
        brake = min(max(self._brake * slip_rate, -BRAKE_LIMIT), BRAKE_LIMIT)
        link_force = stiffness * (roll - slip) + link_damping * (speed - slip_rate)
        stop_force = 2 * abs(link_force - spring * slip - damping * slip_rate - brake)
        return link_force, stop_force
