"""Rides that several tests look at."""

import pytest

from sidm.explorer import ROBOTS, Ride, ride
from sidm.systems import Terrain


@pytest.fixture(scope="session")
def rides() -> dict[str, Ride]:
    """Two robots over the same ground for half a second."""
    ground = Terrain(cell_height_scale=0.35)
    return {name: ride(ROBOTS[name], ground, 3, 0.5, steps=5) for name in ("system1 novice", "system2 expert")}
