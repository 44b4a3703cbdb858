"""The robots in simulation: the only part of the package that needs PyBullet."""

try:
    import pybullet  # noqa: F401
except ImportError as error:
    raise ImportError("simulating needs PyBullet: pip install pybullet (all else works without it)") from error

from sidm.simulation.collect import collect, discards, simulate
from sidm.simulation.exploration import POLICIES, draw_actions
from sidm.simulation.simulator import Simulator

__all__ = ["POLICIES", "Simulator", "collect", "discards", "draw_actions", "simulate"]
