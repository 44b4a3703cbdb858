"""How much of the novice's motion the expert's covers, from nearest neighbours alone.

No network is trained. For steps of the novice's validation set the nearest states and
actions (the 11 numbers of x without the map) are looked up among the expert's steps,
and among as many of the novice's own. Their distance says whether the expert has been
in such states. The transitions that followed there are averaged as a prediction, whose
loss says whether the expert moved like the novice.

`companion run --figure overlap` measures it and writes `results/overlap.json`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from companion.engine.records import read_or_empty
from companion.study import Study
from sidm.drives import STEPS, Drive
from sidm.shards import load
from sidm.systems import PAPER_SYSTEMS

MOST = 40_000  # steps of each robot, at most, among which neighbours are looked up
QUERIES = 5_000  # steps of the validation set
NEIGHBOURS = 10  # the mean of their transitions is the prediction
#: Quantile of the novice's own distances beyond which a step counts as not covered.
FAR = 0.95
NAME = "overlap.json"


class Neighbourhood(NamedTuple):
    """How near one robot's steps are to the novice's validation steps."""

    #: median to the nearest step, in standard deviations of each of the expert's inputs
    distance: float
    #: share of validation steps farther from this robot's nearest step than the
    #: quantile FAR of the distances to the novice's own
    uncovered: float
    loss: float  # equation (1) of the mean transition of the NEIGHBOURS nearest steps


Steps = tuple[np.ndarray, np.ndarray]  # inputs (N, 11) and transitions (N, 13)


def steps(trajectories: list[Drive], count: int) -> Steps:
    """So many evenly spaced steps, at most."""
    # here, since stored neighbourhoods are read without PyTorch
    from sidm.learning.dataset import states_and_actions
    from sidm.learning.observation import encode_inputs, transition

    states, actions = states_and_actions(trajectories)
    inputs = encode_inputs(states[:, :-1], actions).reshape(-1, 11).numpy()
    targets = transition(states[:, :-1], states[:, 1:]).reshape(-1, 13).numpy()
    even = np.linspace(0, len(inputs) - 1, min(count, len(inputs)))
    chosen = even.round().astype(int)
    return inputs[chosen], targets[chosen]


def neighbourhoods(
    expert: Steps, novice: Steps, queries: Steps
) -> dict[str, Neighbourhood]:
    """Compare both robots' steps with the novice's validation steps."""
    scale = np.maximum(expert[0].std(axis=0), 1e-9)
    nearest, losses = {}, {}
    for role, (inputs, targets) in {"expert": expert, "novice": novice}.items():
        tree = cKDTree(inputs / scale)
        distances, indices = tree.query(queries[0] / scale, k=NEIGHBOURS)
        nearest[role] = distances[:, 0]
        errors = targets[indices].mean(axis=1) - queries[1]
        losses[role] = float((errors**2).sum(axis=1).mean())
    limit = np.quantile(nearest["novice"], FAR)
    return {
        role: Neighbourhood(
            float(np.median(distances)), float((distances > limit).mean()), losses[role]
        )
        for role, distances in nearest.items()
    }


def make(study: Study, workers: int, data: Path, results: Path) -> dict[str, Any]:
    """Measure the neighbourhoods of the paper's systems, in one process."""
    measured = {}
    for system in PAPER_SYSTEMS:
        loaded = {
            kind: load(data, dataset.collection, dataset.count)
            for kind, dataset in study.preset.datasets(system).items()
        }
        count = min(MOST, *(STEPS * len(loaded[kind]) for kind in ("expert", "novice")))
        expert, novice = (steps(loaded[kind], count) for kind in ("expert", "novice"))
        queries = steps(loaded["validation"], QUERIES)
        measured[system] = {
            role: [float(f"{value:.6g}") for value in values]
            for role, values in neighbourhoods(expert, novice, queries).items()
        }
    return measured | {"preset": study.preset.name}


def read(results: Path | str) -> dict[str, dict[str, Neighbourhood]]:
    """The stored neighbourhoods by system and robot; empty if none are stored."""
    stored = read_or_empty(Path(results) / NAME)
    return {
        system: {role: Neighbourhood(*row) for role, row in stored[system].items()}
        for system in PAPER_SYSTEMS
        if system in stored
    }
