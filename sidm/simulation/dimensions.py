"""The robot's figures: masses, sizes and points, one table for all four robots.

Body frame: x forward, y left, z up, origin at the chassis' centre of mass. Source of
all: the authors' released model at its zero position. Masses and inertias are before a
robot's mass scale, which the chassis alone does not follow.
"""

from __future__ import annotations

import numpy as np

# Masses, kg, and inertias about the centre of mass, kg m^2; parts not named here have
# none of their own.
CHASSIS_MASS, CHASSIS_INERTIA = 1.20456, (0.00293, 0.01701, 0.01885)
AXLE_MASS, HUB_MASS, TYRE_MASS = 0.0970, 0.1954, 2.65072
#: two of each an axle
LOWER_LINK_MASS, UPPER_LINK_MASS, STRUT_MASS = 0.0118, 0.0200, 2 * 0.0112
TYRE_INERTIA = (0.01141, 0.01875, 0.01141)  # the second about the axle

# Sizes, m.
CHASSIS_SIZE = (0.403, 0.152, 0.072)
TYRE_RADIUS, TYRE_WIDTH = 0.100, 0.090

# Points of the rear axle's left half, m; mirror y for the right, x for the front.
REAR_AXLE = np.array([-0.3381, 0.0, -0.0669])
REAR_LEFT_HUB = np.array([-0.3427, 0.1225, -0.0740])
REAR_LEFT_TYRE = np.array([-0.3427, 0.1800, -0.0740])
# (rod, end on the axle then on the chassis, xyz): lower link, upper link, strut
REAR_LEFT_RODS = np.array(
    [
        [(-0.3225, 0.0708, -0.0852), (-0.1010, 0.0615, -0.0240)],
        [(-0.3159, 0.0160, -0.0139), (-0.1250, 0.0445, 0.0139)],
        [(-0.3182, 0.0920, -0.0688), (-0.1895, 0.0710, 0.0240)],
    ]
)
FRONT_LEFT_KINGPIN = np.array([0.3427, 0.1150, -0.0740])
#: the same left and right; positive steering turns right
KINGPIN_AXIS = np.array([0.255, -0.264, -0.930])

AXLES, SIDES = ("rear", "front"), ("right", "left")


def mirror(axle: str, side: str) -> np.ndarray:
    """Signs (3,) that take a point of the rear left quarter to the named one."""
    return np.array(
        [1.0 if axle == "rear" else -1.0, 1.0 if side == "left" else -1.0, 1.0]
    )
