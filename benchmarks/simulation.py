"""Measure how fast the simulator is and what a physics step spends its time on.

The rates stand beside those of the released simulator. They are per second of CPU time
of one process; collection with one and with two processes is per second of wall-clock
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

#: control steps and terrains a second of the released code on one core, as measured on
#: machines of this kind
RELEASED_STEPS, RELEASED_TERRAINS = 7.0, 1 / 2.5


def driving(simulator: Simulator, actions: np.ndarray) -> Callable[[], int]:
    """Function that drives on through `actions` (T, 2) and counts its control steps."""

    def drive() -> int:
        for action in actions:
            simulator.step(action)
        return len(actions)

    return drive


def without_python(simulator: Simulator, steps: int) -> Callable[[], int]:
    """Function that lets Bullet alone step the scene and counts its control steps.

    The springs and the motors' controls are left out.
    """

    def advance() -> int:
        for _ in range(steps * simulator.physics.steps_per_control):
            simulator._client.stepSimulation()
        return steps

    return advance


def measure_stepping(system: System, role: str, heights: np.ndarray) -> None:
    """Measure control steps, and as their lower bound Bullet's own steps of the scene.

    Settling and terrain are not counted.
    """
    actions = draw_actions("ornstein_uhlenbeck", STEPS, np.random.default_rng(0))
    with Simulator(system.robot(role), heights, system.physics) as simulator:
        rates = rate(driving(simulator, actions), simulator.reset)
        report(
            f"{system.name} {role}: control steps", rates, "a s of CPU", RELEASED_STEPS
        )

        def start() -> None:
            simulator.reset()
            # the wheels keep this action's speeds and steering from here on
            simulator.step(actions[STEPS // 2])

        floor = rate(without_python(simulator, STEPS), start)
        step = 1e6 / system.physics.steps_per_control / np.median(rates)
        share = np.median(rates) / np.median(floor)
        print(
            f"    a physics step: {step:.0f} us, {share:.2f} of it in Bullet's own step"
        )


def measure_parts(system: System, heights: np.ndarray) -> None:
    """Measure physics steps also without contacts and with few solver iterations."""
    usual = system.physics
    aloft = dataclasses.replace(usual, drop_height=1e4, gravity=1e-6)
    few = dataclasses.replace(usual, solver_iterations=10)
    cases = {"as it is": usual, "no contacts": aloft, "10 solver iterations": few}
    for name, physics in cases.items():
        with Simulator(system.novice, heights, physics) as simulator:
            rates = rate(without_python(simulator, STEPS), simulator.reset)
            report(f"{system.name} novice at rest, {name}", rates, "a s of CPU")


def collecting(workers: int, shards: int = 6) -> float:
    """Kept control steps a second of wall-clock time of a new collection.

    The folder is empty at first, and the time includes starting the processes.
    """
    collection = Collection(
        system="system1", role="novice", policy="ornstein_uhlenbeck", seed=99
    )
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        count = workers * shards * SHARD_SIZE
        collect(folder, collection, count, workers=workers, progress=False)
        return count * STEPS / (time.perf_counter() - start)


def measure_collection(rounds: int = 3) -> None:
    """Measure whole collections with one process and with two.

    The two take turns, so that other work of the machine disturbs both.
    """
    pairs = np.array([[collecting(1), collecting(2)] for _ in range(rounds)])
    report("collect, one process: control steps", pairs[:, 0], "a s", RELEASED_STEPS)
    report("collect, two processes: control steps", pairs[:, 1], "a s", RELEASED_STEPS)
    report("two processes over one", pairs[:, 1] / pairs[:, 0], "times")


def main() -> None:
    """Measure terrains, stepping and its parts, new simulators and collection."""
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
            simulator.set_terrain(heights)
            return 1

        report("terrains exchanged under a simulator", rate(exchange), "a s of CPU")
    measure_collection()


if __name__ == "__main__":
    main()
