"""What an axle's struts and links push with: springs, dampers, stops, brakes, and the give of the linkage.

In the released simulator two things come on top of spring and damper, neither meant.
Bullet gives every joint a velocity motor, and those of the struts were never switched
off: they brake each strut with up to 500 N. And the links close by constraints that 300
solver iterations do not settle. So the axle that the solver treats first, the rear one,
is held, but for a slow creep; the front one gives way like a viscous damper, in heave
and more easily in roll; and both roll elastically as their links give. `BRAKED` states
those laws as measured on the closed mechanism, rebuilt from its points: responses in
free space to steps of force and of roll torque, and the rear axle's roll under its
wheels' forces.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sidm.simulation.linkage import AxleJoints, axle_joints
from sidm.systems import Physics, Robot

#: N, a strut: the motors' 500 N; the closed mechanism yields at this load
BRAKE_LIMIT = 550.0
#: m: an axle rolled from stop to stop shares the force among both where they are as
#: near as this
STOP_BLEND = 0.004


class Brake(NamedTuple):
    """What a braked axle's motion is like beside its spring and damper; dampings go with the mass scale."""

    #: of the spring's and damper's force, what moves the axle in heave; 0: no heave at
    #: all
    heave_share: float
    heave_damping: float  # of each strut in heave, N s/m
    roll_damping: float  # of the struts in roll, N m s/rad; a large one is a slow creep
    #: of the links in roll, N m/rad, in series with the struts; goes with the mass
    #: scale
    link_stiffness: float
    #: beside their stiffness, N m s/rad; goes with the mass scale
    link_damping: float = 2.0
    #: direction; point, m
    roll_line: tuple[tuple[float, float, float], tuple[float, float, float]] | None = (
        None
    )


BRAKED = {
    # Hung on its lower right link by a joint and on the rest by constraints, the rear
    # axle rolls about its own line.
    "rear": Brake(
        0.0,
        0.0,
        roll_damping=150.0,
        link_stiffness=85.0,
        roll_line=((1.0, 0.07, 0.27), (-0.3427, -0.005, 0.030)),
    ),
    "front": Brake(
        heave_share=0.49, heave_damping=1050.0, roll_damping=2.2, link_stiffness=105.0
    ),
}
#: With struts that give way at once, more damping of the links was unstable in steps of
#: 2 ms: it acts explicitly on the chassis, whose moment of inertia is 0.003 kg m^2, and
#: robots of 1.5 times the mass leapt from their stops.
FREE = Brake(
    heave_share=1.0,
    heave_damping=0.0,
    roll_damping=0.0,
    link_stiffness=105.0,
    link_damping=0.5,
)


class Suspension:
    """The struts of one axle: torques on its two joints, and the struts' travel.

    Half the difference of the struts' travels follows the axle's roll through the
    links' give. It has no mass, so it is a state of this class and not of Bullet's:
    `slip`, m, left more compressed positive.
    """

    def __init__(self, robot: Robot, axle: str, physics: Physics) -> None:
        """The suspension of a robot's 'rear' or 'front' axle, both struts at zero."""
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
        self._heave_damping = (
            law.heave_share * robot.damping + scale * law.heave_damping
        )
        # of each strut, in N/m and N s/m: the joint's torque is twice a strut's force a
        # rate
        per_strut = scale * self.joints.roll_rate(0.0) ** 2 / 2
        self._brake = per_strut * law.roll_damping
        self._link_stiffness, self._link_damping = (
            per_strut * law.link_stiffness,
            per_strut * law.link_damping,
        )

    def travel(self, heave_angle: float) -> tuple[float, float]:
        """Travel of the right and the left strut, m; on an axle without heave the one that gives extends."""
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
        """Torques, N m, on the heave and the roll joint for the coming physics step; the slip moves on by that step.

        Args:
            heave_angle: of the heave joint, rad.
            heave_speed: rad/s.
            roll_angle: of the roll joint, rad.
            roll_speed: rad/s.
        """
        middle = self.joints.mean_travel(heave_angle)
        # rad/m, rad/m^2
        rate, growth = self.joints.roll_rate(middle), self.joints.roll_rates[0]
        above, below = (
            self.robot.travel_upper - middle,
            middle - self.robot.travel_lower,
        )
        room = max(min(above, below), 0.0) if self.heave_free else below / 2
        roll = roll_angle / rate
        links, stop = self._slide(roll, roll_speed / rate, room)

        a, b, _ = self.joints.heave_travel
        lever = 2 * a * heave_angle + b  # m/rad
        force = 2 * self._heave_spring * (self.robot.spring_offset - middle)
        force -= 2 * self._heave_damping * lever * heave_speed
        force += min(max((above - below) / STOP_BLEND, -1.0), 1.0) * stop
        # the links pull towards where the same roll takes less slip
        force += 2 * links * roll * growth / rate
        return force * lever, -2 * links / rate

    def _slide(self, roll: float, speed: float, room: float) -> tuple[float, float]:
        """Move the slip by a step, implicitly: what the links push with is what spring, damper, brake and stop hold.

        Args:
            roll: of the axle, m of slip.
            speed: its rate, m/s.
            room: how far either way the slip can go before a strut meets its stop, m.

        Returns:
            The links' force on each strut, and the stop's on the one that has met it,
            N.
        """
        spring, damping, dt = self.robot.spring, self.robot.damping, self._dt
        stiffness, give = self._link_stiffness, self._link_damping
        push = stiffness * (roll - self.slip) + give * speed - spring * self.slip
        yielding = damping + give + (stiffness + spring) * dt
        slide = push / (yielding + self._brake)
        if self._brake * abs(slide) > BRAKE_LIMIT:
            slide = (push - math.copysign(BRAKE_LIMIT, push)) / yielding
        slip = min(max(self.slip + slide * dt, -room), room)
        slide, self.slip = (slip - self.slip) / dt, slip
        brake = min(max(self._brake * slide, -BRAKE_LIMIT), BRAKE_LIMIT)
        links = stiffness * (roll - slip) + give * (speed - slide)
        return links, 2 * abs(links - spring * slip - damping * slide - brake)
