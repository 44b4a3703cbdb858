"""How far a pair's expert and novice go apart under the same actions, before learning.

Both robots stand at rest on the same ground with the same heading, and get the same
random actions. The gap is the difference between their motions, component by component,
which a model of the novice has to learn. `studies.when_it_pays` measures another gap, a
ratio of prediction errors.

`companion run --figure gap` measures it and writes `results/gap.json`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.engine.records import read_or_empty
from companion.figures.dots import dot_plot
from companion.figures.style import system_label
from companion.study import Study
from sidm.drives import CONTROL_STEP, QUATERNION, tilt_of, yaw_of
from sidm.pool import local_pool
from sidm.systems import FREE_SYSTEMS, PAPER_SYSTEMS, ROLES, find_system
from sidm.terrain import generate_terrain

GAP_SEED = 6  # differs from the seeds of all data
POLICY = "ornstein_uhlenbeck"
STARTS, STEPS = 96, 25  # drives of each robot, and control steps of each drive
BATCH = 12  # starts that one job of a worker simulates
EVERY_SYSTEM = (*PAPER_SYSTEMS, *FREE_SYSTEMS)
NAME = "gap.json"

#: Components of the motion since the start, in the frame of the start, and the
#: velocities, with their units.
COMPONENTS = (
    dict.fromkeys(["forward", "sideways", "up"], "m")
    | dict.fromkeys(["roll", "pitch", "heading"], "rad")
    | {f"{way} velocity": "m/s" for way in ("forward", "sideways", "upward")}
    | {f"{turn} rate": "rad/s" for turn in ("roll", "pitch", "yaw")}
)


def simulate_components(system: str, starts: Sequence[int]) -> np.ndarray:
    """COMPONENTS (2, N, STEPS + 1, 12) of a pair's novice, then expert, from N starts.

    Both get the same ground, heading and actions, which are drawn from the number of
    the start.
    """
    from sidm.simulation import Simulator
    from sidm.simulation.exploration import draw_actions

    pair, motions = find_system(system), []
    flat = np.zeros((pair.terrain.size, pair.terrain.size))
    for role in ROLES:
        paths = []
        with Simulator(pair.robot(role), flat, pair.physics) as simulator:
            for start in starts:
                seeds = np.random.SeedSequence(GAP_SEED, spawn_key=(start,))
                rng = np.random.default_rng(seeds)
                terrain_seed = int(rng.integers(2**62))
                yaw = float(rng.uniform(-np.pi, np.pi))
                actions = draw_actions(POLICY, STEPS, rng)
                simulator.set_terrain(generate_terrain(pair.terrain, terrain_seed))
                first = simulator.reset(0.0, 0.0, yaw)
                states = [first, *(simulator.step(action) for action in actions)]
                paths.append(components(np.array(states), yaw))
        motions.append(paths)
    return np.array(motions)


def components(states: np.ndarray, yaw: float) -> np.ndarray:
    """COMPONENTS (K, 12) of states (K, 13) that start with the heading `yaw`, rad."""
    pitch, roll = tilt_of(states[:, QUATERNION])
    heading = np.unwrap(yaw_of(states[:, QUATERNION]))
    x, y, z = (states[:, :3] - states[0, :3]).T
    forward = np.cos(yaw) * x + np.sin(yaw) * y
    sideways = np.cos(yaw) * y - np.sin(yaw) * x
    turned = heading - heading[0]
    return np.column_stack([forward, sideways, z, roll, pitch, turned, states[:, 7:13]])


def make(study: Study, workers: int, data: Path, results: Path) -> dict[str, Any]:
    """Measure the gap at every step.

    The gap is the root mean square, over the starts, of the difference between the
    expert's and the novice's component. The spread is the standard deviation of the
    novice's component over the starts; the gap is compared with it.
    """
    batches = [
        range(first, min(first + BATCH, STARTS)) for first in range(0, STARTS, BATCH)
    ]
    measured = {}
    with local_pool(workers) as pool:
        jobs = {
            system: [pool.submit(simulate_components, system, part) for part in batches]
            for system in EVERY_SYSTEM
        }
        for system, parts in jobs.items():
            motions = np.concatenate([part.result() for part in parts], axis=1)
            novice, expert = motions  # (N, STEPS + 1, 12) each
            gap = np.sqrt(((expert - novice) ** 2).mean(0))
            measured[system] = {
                "gap": gap.round(6).tolist(),
                "spread": novice.std(0).round(6).tolist(),
            }
    return {"found": measured}


def table(results: Path | str = "results") -> pd.DataFrame:
    """The stored gaps as a table, without rows if none are stored.

    One row per system, component and `time`, s: `gap`, the novice's `spread`, and their
    `ratio`.
    """
    stored = read_or_empty(Path(results) / NAME).get("found", {})
    rows = [
        (system, name, unit, CONTROL_STEP * step)
        + tuple(values[which][step][number] for which in ("gap", "spread"))
        for system, values in stored.items()
        for number, (name, unit) in enumerate(COMPONENTS.items())
        for step in range(1, STEPS + 1)
    ]
    names = ["system", "component", "unit", "time", "gap", "spread"]
    frame = pd.DataFrame(rows, columns=names)
    return frame.assign(ratio=frame.gap / frame.spread)


def figure(table: pd.DataFrame, time: float = 1.0) -> Figure:
    """Ratio of gap to the novice's spread after `time` s, a plot per pair of robots."""
    rows = table[np.isclose(table.time, time)]
    dots = rows.assign(
        panel=rows.system.map(system_label),
        row=rows.component,
        group="",
        method="",
        value=rows.ratio,
        low=np.nan,
        high=np.nan,
    )
    return dot_plot(dots, f"gap after {time:g} s / novice's spread")
