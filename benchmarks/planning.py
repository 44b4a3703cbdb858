"""Measure how many plans a second a planner makes with a learned model.

`python benchmarks/planning.py` takes half a minute. The networks are those of the
preset `laptop`; they are untrained, which takes as long. The time of a plan includes
the steps driven since the last plan. `companion run --figure driving` stores the times
of its own plans, made on one thread while other work runs.
"""

from __future__ import annotations

import functools
import time

import numpy as np
import torch

from companion.extensions.planning import ModelImagination, Planner, Planning
from companion.presets import load_preset
from sidm.learning import DynamicsModel
from sidm.systems import SYSTEMS
from sidm.terrain import generate_terrain

ROUNDS, PLANS = 5, 30
#: state (13,) of a robot that stands level at the origin
HERE = np.array([0, 0, 0.2, 0, 0, 0, 1, *[0] * 6], float)


def seconds_a_plan(settings: Planning, threads: int) -> np.ndarray:
    """Seconds of each plan of one round, (PLANS - 1,): the first plan warms up."""
    torch.set_num_threads(threads)
    network = load_preset("laptop").network
    model = DynamicsModel(network, roles=["novice"]).eval().requires_grad_(False)
    heights = generate_terrain(SYSTEMS["system1"].terrain, 0)
    dreamer = ModelImagination(model, heights, network.pixels, settings.horizon)
    planner, taken = Planner(settings, np.array([5.0, 2.0]), 0), []
    for _ in range(PLANS):
        start = time.perf_counter()
        plan = planner.plan(functools.partial(dreamer.imagine, HERE))
        taken.append(time.perf_counter() - start)
        for action in plan[: settings.replan]:
            dreamer.observe(HERE, action)
    return np.array(taken[1:])


def main() -> None:
    """Print plans a second with one thread and with two.

    Each line has the median round, the slowest and the fastest round in brackets, and
    the rate of the slowest plans.
    """
    settings = Planning()
    print(
        f"{settings.samples} sequences of {settings.horizon} control steps a plan, "
        f"timed in {ROUNDS} rounds"
    )
    for threads in (1, 2):
        rounds = [seconds_a_plan(settings, threads) for _ in range(ROUNDS)]
        rates = [1 / np.median(times) for times in rounds]
        slow = 1 / np.percentile(np.concatenate(rounds), 95)
        print(
            f"{threads} thread{'s' * (threads > 1)}: "
            f"{np.median(rates):5.1f} plans a second "
            f"[{min(rates):.1f}, {max(rates):.1f}]; "
            f"the slowest 5 %: fewer than {slow:.1f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
