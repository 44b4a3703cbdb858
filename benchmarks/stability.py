"""Measure how stable the simulator is over thousands of trajectories of each robot.

Each robot drives on the terrain of its own system. The script prints how the
trajectories ended, the highest speed of the body and the largest distance by which a
strut passed its stops. Finished parts are kept in the data folder, so that a killed run
can go on; delete them after a change of the simulator.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
from collections import Counter
from pathlib import Path

import numpy as np
from tqdm import tqdm

from sidm.drives import STEPS, TWIST
from sidm.simulation import Simulator, draw_actions
from sidm.simulation.collecting import EpisodeRules
from sidm.systems import ROLES, SYSTEMS
from sidm.terrain import generate_terrain

PART = 25  # trajectories in one part


def drive(name: str, role: str, index: int) -> dict[str, float | str]:
    """Drive one trajectory from the middle of new ground.

    Returns:
        How the trajectory ended, the highest speed of the body, m/s, and the largest
        distance of a strut past its stops, m.
    """
    system = SYSTEMS[name]
    robot, rng = system.robot(role), np.random.default_rng([2021, index])
    heights = generate_terrain(system.terrain, int(rng.integers(2**62)))
    policy = ("ornstein_uhlenbeck", "bounded_noise")[index % 2]
    with Simulator(robot, heights, system.physics) as simulator:
        state = simulator.reset(0.0, 0.0, rng.uniform(-np.pi, np.pi))
        rules, cause = EpisodeRules(state, system.terrain.half_width), None
        fastest, overshoot = 0.0, 0.0
        for action in draw_actions(policy, STEPS, rng):
            state, struts = simulator.step(action), simulator.strut_positions
            fastest = max(fastest, float(np.linalg.norm(state[TWIST][:3])))
            below = float(robot.travel_lower - struts.min())
            above = float(struts.max() - robot.travel_upper)
            overshoot = max(overshoot, below, above)
            cause = rules.ended(state)
            if cause:
                break
    return {"end": cause or "whole", "fastest": fastest, "overshoot": overshoot}


def make_part(job: tuple[Path, str, str, int]) -> int:
    """Drive and store one part of a robot's trajectories; return their number."""
    path, name, role, number = job
    rows = [drive(name, role, PART * number + k) for k in range(PART)]
    path.write_text(json.dumps(rows), encoding="utf-8")
    return PART


def main() -> None:
    """Drive the missing parts and print a line for each robot."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add = parser.add_argument
    cost = "of each robot; 2000 take an hour on two cores"
    add("--trajectories", type=int, default=100, help=cost)
    folder = Path("data/stability")
    add("--data", type=Path, default=folder, help="where parts are kept")
    add("--workers", type=int, help="processes, one a core when not given")
    options = parser.parse_args()
    options.data.mkdir(parents=True, exist_ok=True)
    parts = -(-options.trajectories // PART)
    robots = [(name, role) for name in SYSTEMS for role in ROLES]
    jobs = [
        (options.data / f"{name}-{role}-{number:03d}.json", name, role, number)
        for number in range(parts)
        for name, role in robots
    ]
    missing = [job for job in jobs if not job[0].exists()]
    with (
        multiprocessing.Pool(options.workers) as pool,
        tqdm(total=PART * len(missing), unit="traj") as bar,
    ):
        for count in pool.imap_unordered(make_part, missing):
            bar.update(count)
    for name, role in robots:
        paths = [path for path, *robot, _ in jobs if robot == [name, role]]
        rows = [row for path in paths for row in json.loads(path.read_text())]
        ends = Counter(row["end"] for row in rows)
        shares = ", ".join(
            f"{end} {100 * ends[end] / len(rows):.1f} %" for end in sorted(ends)
        )
        print(
            f"{name} {role}: {len(rows)} trajectories: {shares}; "
            f"fastest body {max(row['fastest'] for row in rows):.1f} m/s; "
            f"struts at most {1e3 * max(row['overshoot'] for row in rows):.1f} mm "
            "past their stops"
        )


if __name__ == "__main__":
    main()
