"""How far a pair's expert and novice go apart from the same state under the same actions, before any learning.

Both stand at rest on the same ground with the same heading, and are given the same
random actions. What the expert does other than the novice, by component, is the gap
that a model of the novice has to learn. Run as a module it measures anew and writes
`results/gap.json`.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.engine.records import single
from companion.figures.style import SIZE_STYLES, legend_below
from companion.numerics import versions
from companion.study import Study
from sidm.config import to_mapping
from sidm.drives import CONTROL_STEP, QUATERNION, tilt_of, yaw_of
from sidm.plots import finish, side_by_side, styled
from sidm.pool import local_pool
from sidm.storage import write_record
from sidm.systems import FREE_SYSTEMS, ROLES, SYSTEMS, find_system
from sidm.terrain import generate_terrain

GAP_SEED = 6  # apart from the seeds of all data
POLICY = "ornstein_uhlenbeck"
STARTS, STEPS = 96, 25  # drives of each robot, and control steps of each
BATCH = 12  # starts that a worker drives
EVERY_SYSTEM = (*SYSTEMS, *FREE_SYSTEMS)
NAME = "gap.json"

#: What the robots' motion is told by, in the frame of the start, and the unit.
COMPONENTS = {
    "forward": "m",
    "sideways": "m",
    "up": "m",
    "roll": "rad",
    "pitch": "rad",
    "heading": "rad",
    "forward velocity": "m/s",
    "sideways velocity": "m/s",
    "upward velocity": "m/s",
    "roll rate": "rad/s",
    "pitch rate": "rad/s",
    "yaw rate": "rad/s",
}


def drives(system: str, numbers: Sequence[int]) -> np.ndarray:
    """(2, N, STEPS + 1, 12) COMPONENTS of the novice's and the expert's motion from starts of those numbers."""
    from sidm.simulation import Simulator
    from sidm.simulation.exploration import draw_actions

    own, found = find_system(system), []
    for role in ROLES:
        paths = []
        with Simulator(
            own.robot(role), np.zeros((own.terrain.size, own.terrain.size)), own.physics
        ) as simulator:
            for number in numbers:
                rng = np.random.default_rng(
                    np.random.SeedSequence(GAP_SEED, spawn_key=(number,))
                )
                terrain_seed, yaw = (
                    int(rng.integers(2**62)),
                    float(rng.uniform(-np.pi, np.pi)),
                )
                actions = draw_actions(POLICY, STEPS, rng)
                simulator.put_on(generate_terrain(own.terrain, terrain_seed))
                states = [
                    simulator.reset(0.0, 0.0, yaw),
                    *(simulator.step(action) for action in actions),
                ]
                paths.append(components(np.array(states), yaw))
        found.append(paths)
    return np.array(found)


def components(states: np.ndarray, yaw: float) -> np.ndarray:
    """(K, 12) COMPONENTS of states (K, 13) that began with a heading `yaw`, rad."""
    pitch, roll = tilt_of(states[:, QUATERNION])
    heading = np.unwrap(yaw_of(states[:, QUATERNION]))
    moved = states[:, :3] - states[0, :3]
    forward = np.cos(yaw) * moved[:, 0] + np.sin(yaw) * moved[:, 1]
    sideways = np.cos(yaw) * moved[:, 1] - np.sin(yaw) * moved[:, 0]
    return np.column_stack(
        [
            forward,
            sideways,
            moved[:, 2],
            roll,
            pitch,
            heading - heading[0],
            states[:, 7:13],
        ]
    )


def measure(
    executor: Executor,
    results: Path,
    systems: Sequence[str] = EVERY_SYSTEM,
    starts: int = STARTS,
) -> None:
    """Drive all pairs, and store by step the gap and what it is to be held against.

    The gap is the root mean square of the expert's component less the novice's over the
    starts; the novice's own spread its standard deviation over them.
    """
    batches = [
        range(first, min(first + BATCH, starts)) for first in range(0, starts, BATCH)
    ]
    jobs = {
        system: [executor.submit(drives, system, batch) for batch in batches]
        for system in systems
    }
    found = {}
    for system, parts in jobs.items():
        # (N, STEPS + 1, 12) each
        novice, expert = np.concatenate([part.result() for part in parts], axis=1)
        gap, own = np.sqrt(((expert - novice) ** 2).mean(0)), novice.std(0)
        found[system] = {
            name: np.array(values).round(6).tolist()
            for name, values in (("gap", gap), ("spread", own))
        }
    robots = {system: to_mapping(find_system(system)) for system in systems}
    made = {"starts": starts, "systems": robots, "numerics": versions("free_struts")}
    write_record(results / NAME, {"found": found, **made})


def table(results: Path | str = "results") -> pd.DataFrame:
    """A line a system, component and time: `gap`, the novice's own `spread`, their `ratio`; empty if not measured."""
    found = single(Path(results) / NAME).get("found", {})
    lines = [
        (
            system,
            name,
            unit,
            CONTROL_STEP * step,
            both["gap"][step][number],
            both["spread"][step][number],
        )
        for system, both in found.items()
        for number, (name, unit) in enumerate(COMPONENTS.items())
        for step in range(1, STEPS + 1)
    ]
    frame = pd.DataFrame(
        lines, columns=["system", "component", "unit", "time", "gap", "spread"]
    )
    return frame.assign(ratio=frame.gap / frame.spread)


@styled
def figure(table: pd.DataFrame, time: float = 1.0) -> Figure:
    """The gap of each component after some time, s, by the novice's own spread then: a mark a system."""
    figure, (axes,) = side_by_side(1)
    figure.set_size_inches(8, 4.6)
    names = list(COMPONENTS)
    at = table[np.isclose(table.time, time)]
    for number, (system, mine) in enumerate(at.groupby("system", sort=False)):
        height = mine.component.map(names.index) + 0.15 * (number - 1.5)
        axes.plot(
            mine.ratio,
            height,
            **SIZE_STYLES[number % len(SIZE_STYLES)]
            | {"linestyle": "", "label": system},
        )
    axes.set(
        xlabel=f"gap after {time:g} s by the novice's own spread (-)", xscale="log"
    )
    finish(axes, legend=False)
    if len(at):
        axes.axvline(1, color="0.5", lw=1, linestyle="-", marker="", zorder=0)
        axes.set_xticks([0.5, 1, 2, 5, 10], ["0.5", "1", "2", "5", "10"])
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.5, -0.5)
    legend_below(figure, [axes])
    return figure


def make(study: Study, workers: int) -> None:
    """`companion run --figure gap`."""
    with local_pool(workers) as pool:
        measure(pool, study.results)
