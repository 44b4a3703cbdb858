"""How many plans a second a learned model makes: python benchmarks/planning.py, half a minute.

The networks of the preset `laptop`, untrained, which takes as long; a plan takes in the
steps that were driven since the one before. `companion run --figure driving` stores
what its own plans took, on one thread beside other work.
"""

from __future__ import annotations

import functools
import time

import numpy as np
import torch

from companion.beyond.planning import Dreamer, Planner, Planning
from companion.presets import load_preset
from sidm.learning import DynamicsModel
from sidm.systems import SYSTEMS
from sidm.terrain import generate_terrain

ROUNDS, PLANS = 5, 30
HERE = np.array([0, 0, 0.2, 0, 0, 0, 1, *[0] * 6], float)


def seconds_a_plan(settings: Planning, threads: int) -> np.ndarray:
    """(PLANS,) of one round."""
    torch.set_num_threads(threads)
    network = load_preset("laptop").network
    model = DynamicsModel(network, roles=["novice"]).eval().requires_grad_(False)
    dreamer = Dreamer(
        model,
        generate_terrain(SYSTEMS["system1"].terrain, 0),
        network.pixels,
        settings.horizon,
    )
    planner, taken = Planner(settings, np.array([5.0, 2.0]), 0), []
    for _ in range(PLANS):
        start = time.perf_counter()
        plan = planner.plan(functools.partial(dreamer.imagine, HERE))
        taken.append(time.perf_counter() - start)
        for action in plan[: settings.replan]:
            dreamer.observe(HERE, action)
    return np.array(taken[1:])  # the first warms up


def main() -> None:
    """A line a number of threads: the median round, the least and the most of them, and the slowest plans."""
    settings = Planning()
    print(
        f"{settings.samples} sequences of {settings.horizon} control steps a plan, timed in {ROUNDS} rounds"
    )
    for threads in (1, 2):
        rounds = [seconds_a_plan(settings, threads) for _ in range(ROUNDS)]
        rates = [1 / np.median(one) for one in rounds]
        slow = 1 / np.percentile(np.concatenate(rounds), 95)
        print(
            f"{threads} thread{'s' * (threads > 1)}: {np.median(rates):5.1f} plans a second "
            f"[{min(rates):.1f}, {max(rates):.1f}]; the slowest 5 %: fewer than {slow:.1f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
