"""The robots in simulation: the only part of the package that needs PyBullet, when it first simulates."""

from sidm.simulation.collecting import collect, discards, simulate_trajectory
from sidm.simulation.exploration import POLICIES, draw_actions
from sidm.simulation.motion import simulate
from sidm.simulation.simulator import Simulator

__all__ = [
    "POLICIES",
    "Simulator",
    "collect",
    "discards",
    "draw_actions",
    "simulate",
    "simulate_trajectory",
]
