"""How much motion of each robot was collected, and what was thrown away on the way.

`python -m companion.studies.collected DATA` counts what lies in a data folder, and
writes `results/collected.json`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from companion.engine.records import read_or_empty
from companion.figures.style import system_label
from companion.numerics import versions
from sidm.drives import CONTROL_STEP, STEPS, TWIST
from sidm.shards import DISCARDS
from sidm.storage import read_arrays, write_record
from sidm.systems import PAPER_SYSTEMS, ROLES

NAME = "collected.json"
POLICY = "ornstein_uhlenbeck"


def measure(data: Path, results: Path) -> None:
    """Count the trajectories of the paper's robots in a data folder, and store it."""
    found = {}
    for robot in (f"{system} {role}" for system in PAPER_SYSTEMS for role in ROLES):
        shards = data.joinpath(*robot.split(), POLICY).glob("seed-*/shard-*.npz")
        columns = [read_arrays(path) for path in shards]
        if not columns:
            continue
        states, discarded = (
            np.concatenate([shard[name] for shard in columns])
            for name in ("states", "discarded")
        )
        found[robot] = {
            "trajectories": len(states),
            "speed": round(float(np.abs(states[:, :, TWIST][..., 0]).mean()), 4),
            "discarded": dict(zip(DISCARDS, discarded.sum(0).tolist(), strict=True)),
        }
    record = {"found": found, "policy": POLICY, "numerics": versions("simulation")}
    write_record(results / NAME, record)


def table(results: Path | str = "results") -> pd.DataFrame:
    """What was collected, a row a robot, without rows if nothing is stored.

    The columns are `robot`, `hours`, mean `speed`, m/s, all `attempts`, and those that
    were thrown away for each cause.
    """
    rows = []
    for robot, counts in read_or_empty(Path(results) / NAME).get("found", {}).items():
        kept, causes = counts["trajectories"], counts["discarded"]
        hours = kept * STEPS * CONTROL_STEP / 3600
        first = {"robot": system_label(robot), "hours": hours, "speed": counts["speed"]}
        rows.append(first | {"attempts": kept + sum(causes.values())} | causes)
    columns = ["robot", "hours", "speed", "attempts", *DISCARDS]
    return pd.DataFrame(rows, columns=columns)


if __name__ == "__main__":
    measure(Path(sys.argv[1]), Path("results"))
