"""How fast the simulator is, beside the released one's figures, and what a physics step spends its time on.

Rates are a second of CPU time, one process; scaling to two processes is of wall-clock
time.
"""

from __future__ import annotations

import dataclasses
import tempfile
import time
from collections.abc import Callable

import numpy as np
from rounds import rate, report

from sidm.drives import STEPS
from sidm.shards import SHARD_SIZE, Collection
from sidm.simulation import Simulator, collect, draw_actions
from sidm.systems import ROLES, SYSTEMS, System
from sidm.terrain import generate_terrain

#: a second on one core, as measured on machines of this kind
RELEASED_STEPS, RELEASED_TERRAINS = 7.0, 1 / 2.5


def driving(simulator: Simulator, actions: np.ndarray) -> Callable[[], int]:
    """Work that drives on through `actions` (T, 2), in control steps."""

    def drive() -> int:
        for action in actions:
            simulator.step(action)
        return len(actions)

    return drive


def without_python(simulator: Simulator, steps: int) -> Callable[[], int]:
    """Work that lets Bullet alone step the scene as it is, springs and controls left out, in control steps."""

    def advance() -> int:
        for _ in range(steps * simulator.physics.steps_per_control):
            simulator._client.stepSimulation()
        return steps

    return advance


def measure_stepping(system: System, role: str, heights: np.ndarray) -> None:
    """Control steps without settling and terrain, and the floor: the same scene, nothing but Bullet's own step."""
    actions = draw_actions("ornstein_uhlenbeck", STEPS, np.random.default_rng(0))
    with Simulator(system.robot(role), heights, system.physics) as simulator:
        rates = rate(driving(simulator, actions), simulator.reset)
        report(
            f"{system.name} {role}: control steps", rates, "a s of CPU", RELEASED_STEPS
        )

        def start() -> None:
            simulator.reset()
            # its wheel speeds and steering hold from here on
            simulator.step(actions[STEPS // 2])

        floor = rate(without_python(simulator, STEPS), start)
        step = 1e6 / system.physics.steps_per_control / np.median(rates)
        share = np.median(rates) / np.median(floor)
        print(
            f"    a physics step: {step:.0f} us, {share:.2f} of it in Bullet's own step"
        )


def measure_parts(system: System, heights: np.ndarray) -> None:
    """What a physics step costs with something left out: contacts, or all but a few of the solver's iterations."""
    aloft = dataclasses.replace(system.physics, drop_height=1e4, gravity=1e-6)
    few = dataclasses.replace(system.physics, solver_iterations=10)
    for what, physics in {
        "as it is": system.physics,
        "no contacts": aloft,
        "10 solver iterations": few,
    }.items():
        with Simulator(system.novice, heights, physics) as simulator:
            rates = rate(without_python(simulator, STEPS), simulator.reset)
            report(f"{system.name} novice at rest, {what}", rates, "a s of CPU")


def collecting(workers: int, shards: int = 6) -> float:
    """Kept control steps a second of wall-clock time of a collection in an empty folder, processes started anew."""
    collection = Collection(
        system="system1", role="novice", policy="ornstein_uhlenbeck", seed=99
    )
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        count = workers * shards * SHARD_SIZE
        collect(folder, collection, count, workers=workers, progress=False)
        return count * STEPS / (time.perf_counter() - start)


def measure_collection(rounds: int = 3) -> None:
    """End to end with one process and with two, taking turns, so that what else the machine does meets both."""
    pairs = np.array([[collecting(1), collecting(2)] for _ in range(rounds)])
    report("collect, one process: control steps", pairs[:, 0], "a s", RELEASED_STEPS)
    report("collect, two processes: control steps", pairs[:, 1], "a s", RELEASED_STEPS)
    report("two processes over one", pairs[:, 1] / pairs[:, 0], "times")


def main() -> None:
    """Measure terrains, the simulator's construction, stepping, its parts and collection."""
    for system in SYSTEMS.values():
        making = rate(
            lambda system=system: generate_terrain(system.terrain, 1) is not None
        )
        report(f"{system.name}: terrain", making, "a s of CPU", RELEASED_TERRAINS)
        heights = generate_terrain(system.terrain, 1)
        for role in ROLES:
            measure_stepping(system, role, heights)
    measure_parts(system, heights)

    def build() -> int:
        Simulator(system.novice, heights, system.physics).close()
        return 1

    report("simulators built on a given terrain", rate(build), "a s of CPU")
    with Simulator(system.novice, heights, system.physics) as simulator:

        def exchange() -> int:
            simulator.put_on(heights)
            return 1

        report("terrains exchanged under a simulator", rate(exchange), "a s of CPU")
    measure_collection()


if __name__ == "__main__":
    main()
