"""How fast the simulator is on one core, beside the released one's figures (control steps and terrains a second)."""

from __future__ import annotations

import numpy as np
from rounds import rate, report

from sidm.simulation import Simulator, draw_actions
from sidm.systems import ROLES, SYSTEMS
from sidm.terrain import generate_terrain

RELEASED_STEPS, RELEASED_TERRAINS = 7.0, 1 / 2.5  # a second on one core, as measured on machines of this kind
STEPS = 50


def main() -> None:
    """Measure each robot's control steps, and the making of terrain and simulator."""
    rng = np.random.default_rng(0)
    for system in SYSTEMS.values():
        heights = generate_terrain(system.terrain, 1)
        report(
            f"{system.name}: terrain",
            rate(lambda system=system: generate_terrain(system.terrain, 1) is not None),
            "a s of CPU",
            RELEASED_TERRAINS,
        )
        for role in ROLES:
            with Simulator(system.robot(role), heights, system.physics) as simulator:
                actions = draw_actions("bounded_noise", STEPS, rng)

                def drive(simulator=simulator, actions=actions) -> int:
                    simulator.reset()
                    for action in actions:
                        simulator.step(action)
                    return len(actions)

                name = f"{system.name} {role}: control steps, with settling"
                report(name, rate(drive), "a s of CPU", RELEASED_STEPS)
    system = SYSTEMS["system1"]

    def build() -> int:
        Simulator(system.novice, heights, system.physics).close()
        return 1

    report("simulators built on a given terrain", rate(build), "a s of CPU")


if __name__ == "__main__":
    main()
