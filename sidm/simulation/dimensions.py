"""Masses, sizes and points of the robot, the same for all four robots of the paper.

Body frame: x forward, y left, z up, origin at the chassis' centre of mass. All values
come from the authors' released model at its zero position. Masses and inertias are
given before a robot's `mass_scale`, which applies to every part but the chassis.
"""

from __future__ import annotations

import numpy as np

# Masses, kg, and inertias about the centre of mass, kg m^2. Parts without an inertia
# here have none in the released model either.
CHASSIS_MASS, CHASSIS_INERTIA = 1.20456, (0.00293, 0.01701, 0.01885)
AXLE_MASS, HUB_MASS, TYRE_MASS = 0.0970, 0.1954, 2.65072
#: an axle has two of each
LOWER_LINK_MASS, UPPER_LINK_MASS, STRUT_MASS = 0.0118, 0.0200, 2 * 0.0112
TYRE_INERTIA = (0.01141, 0.01875, 0.01141)  # the second one about the wheel's axle

# Sizes, m.
CHASSIS_SIZE = (0.403, 0.152, 0.072)
TYRE_RADIUS, TYRE_WIDTH = 0.100, 0.090

# Points of the rear axle's left half, m; `mirror` gives those of the other quarters.
REAR_AXLE = np.array([-0.3381, 0.0, -0.0669])
REAR_LEFT_HUB = np.array([-0.3427, 0.1225, -0.0740])
REAR_LEFT_TYRE = np.array([-0.3427, 0.1800, -0.0740])
# (3, 2, 3): lower link, upper link, strut; end on the axle, end on the chassis; x, y, z
REAR_LEFT_RODS = np.array(
    [
        [(-0.3225, 0.0708, -0.0852), (-0.1010, 0.0615, -0.0240)],
        [(-0.3159, 0.0160, -0.0139), (-0.1250, 0.0445, 0.0139)],
        [(-0.3182, 0.0920, -0.0688), (-0.1895, 0.0710, 0.0240)],
    ]
)
FRONT_LEFT_KINGPIN = np.array([0.3427, 0.1150, -0.0740])
#: direction of both kingpins; positive steering turns the robot right
KINGPIN_AXIS = np.array([0.255, -0.264, -0.930])

AXLES, SIDES = ("rear", "front"), ("right", "left")


def mirror(axle: str, side: str) -> np.ndarray:
    """Factors (3,), 1 or -1, that take a rear left point to the named axle and side."""
    x, y = 1.0 if axle == "rear" else -1.0, 1.0 if side == "left" else -1.0
    return np.array([x, y, 1.0])
