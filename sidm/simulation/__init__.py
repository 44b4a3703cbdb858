"""The paper's robots in simulation.

No other part of the package needs PyBullet; it is imported when a robot is first
simulated.
"""

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
