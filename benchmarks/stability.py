"""How stable the simulator is: thousands of trajectories of each robot on its own system's terrain.

Prints how each robot's trajectories ended, the fastest body and the farthest that a
strut went past its stops. Finished parts are kept in the data folder, so that a run
that was killed goes on; delete them after a change.
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

PART = 25  # trajectories


def drive(name: str, role: str, index: int) -> dict[str, float | str]:
    """One trajectory from the middle of new ground: how it ended, its fastest body, m/s, and its worst overshoot, m."""
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
            overshoot = max(
                overshoot,
                float(
                    max(
                        robot.travel_lower - struts.min(),
                        struts.max() - robot.travel_upper,
                    )
                ),
            )
            cause = rules.ended(state)
            if cause:
                break
    return {"end": cause or "whole", "fastest": fastest, "overshoot": overshoot}


def make_part(job: tuple[Path, str, str, int]) -> int:
    """Drive and keep one part of a robot's trajectories; how many."""
    path, name, role, number = job
    rows = [drive(name, role, PART * number + k) for k in range(PART)]
    path.write_text(json.dumps(rows), encoding="utf-8")
    return PART


def main() -> None:
    """Drive what is missing and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--trajectories",
        type=int,
        default=100,
        help="of each robot; 2000 take an hour on two cores",
    )
    parser.add_argument(
        "--data", type=Path, default=Path("data/stability"), help="where parts are kept"
    )
    parser.add_argument(
        "--workers", type=int, default=None, help="processes, one a core when not given"
    )
    options = parser.parse_args()
    options.data.mkdir(parents=True, exist_ok=True)
    parts = -(-options.trajectories // PART)
    robots = [(name, role) for name in SYSTEMS for role in ROLES]
    jobs = [
        (options.data / f"{n}-{r}-{k:03d}.json", n, r, k)
        for k in range(parts)
        for n, r in robots
    ]
    missing = [job for job in jobs if not job[0].exists()]
    with (
        multiprocessing.Pool(options.workers) as pool,
        tqdm(total=PART * len(missing), unit="traj") as bar,
    ):
        for count in pool.imap_unordered(make_part, missing):
            bar.update(count)
    for name, role in robots:
        rows = [
            row
            for path, n, r, _ in jobs
            if (n, r) == (name, role)
            for row in json.loads(path.read_text())
        ]
        ends = Counter(row["end"] for row in rows)
        shares = ", ".join(
            f"{end} {100 * ends[end] / len(rows):.1f} %" for end in sorted(ends)
        )
        print(
            f"{name} {role}: {len(rows)} trajectories: {shares}; "
            f"fastest body {max(r['fastest'] for r in rows):.1f} m/s; "
            f"struts at most {1e3 * max(r['overshoot'] for r in rows):.1f} mm past their stops"
        )


if __name__ == "__main__":
    main()
