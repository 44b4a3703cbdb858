"""Five control steps of every robot give the figures of today's versions."""

import numpy as np
import pytest

from sidm.simulation import POLICIES, Simulator
from sidm.simulation.exploration import draw_actions
from sidm.systems import FREE_PHYSICS, ROLES, SYSTEMS, Physics
from sidm.terrain import generate_terrain

ACTIONS = ((0.8, 0.5), (0.4, -1.0), (-0.6, 0.3), (1.0, 0.0), (0.2, 0.7))
BRAKED = [f"{system} {role}" for system in SYSTEMS for role in ROLES]
UNBRAKED = ["system1 novice unbraked", "system2 expert unbraked"]


def waves() -> np.ndarray:
    """A smooth ground without level places.

    On rocks and on level ground, contacts turn rounding into 1e-3 in a step.
    """
    x = (np.arange(300) - 149.5) * 0.1
    heights = 0.1 * np.sin(0.7 * x) + 0.08 * np.sin(0.9 * x[:, None] + 1)
    return heights - heights.min()


@pytest.mark.parametrize("name", BRAKED + UNBRAKED)
def test_every_robot_comes_to_its_figures(golden, name):
    """States on smaller instruction sets differ by up to 1e-7.

    Where struts are free, they differ by 1e-5 after two steps and part sooner than with
    braked struts; so two steps are compared.
    """
    system, role, *_ = name.split()
    physics, actions, kind = Physics(), ACTIONS, "simulation"
    if name in UNBRAKED:
        physics, actions, kind = FREE_PHYSICS, ACTIONS[:2], "free_struts"
    with Simulator(SYSTEMS[system].robot(role), waves(), physics) as simulator:
        states = [simulator.reset(yaw=0.7), *map(simulator.step, actions)]
        figures = {
            "states": [state.tolist() for state in states],
            "struts": simulator.strut_positions.tolist(),
        }
    golden.hold(name, kind, figures, rel=0, abs=1e-4)


@pytest.mark.parametrize("system", SYSTEMS)
def test_every_ground_comes_to_its_figures(golden, system):
    heights = generate_terrain(SYSTEMS[system].terrain, 5)[::40, ::40]
    figures = {"heights": heights.tolist()}
    golden.hold(f"{system} ground", "simulation", figures, rel=0, abs=1e-7)


@pytest.mark.parametrize("policy", POLICIES)
def test_every_policy_comes_to_its_figures(golden, policy):
    actions = draw_actions(policy, 5, np.random.default_rng(0))
    golden.hold(policy, "simulation", {"actions": actions.tolist()}, rel=0, abs=1e-7)
