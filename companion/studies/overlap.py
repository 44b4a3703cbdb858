"""Whether the expert's motion covers the novice's, and how much alike the two answer: nearest neighbours, no network.

For steps of the novice's validation set the nearest states and actions (the 11 numbers
of x, without the map) are looked up among the expert's steps, and among as many of the
novice's own. How far they lie says whether the expert has been there; what followed
there, taken as the prediction, says whether it answered alike.

Run as a module it measures anew and writes `results/overlap.json`.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from scipy.spatial import cKDTree

from companion.engine.datasets import load_dataset
from companion.engine.records import single
from companion.numerics import versions
from companion.study import Study
from sidm.drives import STEPS, Drive
from sidm.learning.observation import encode_inputs, transition
from sidm.storage import write_record
from sidm.systems import SYSTEMS

MOST = 40_000  # steps of each robot, among which neighbours are looked up
QUERIES = 5_000  # steps of the validation set
NEIGHBOURS = 10  # whose mean answer is the prediction
#: quantile of the novice's own distances beyond which a step counts as not covered
FAR = 0.95
NAME = "overlap.json"


class Neighbourhood(NamedTuple):
    """What the nearest steps of one robot are to steps of the novice."""

    #: median of the nearest one, in standard deviations of each of the expert's inputs
    distance: float
    #: share of steps farther from it than FAR of them are from the novice's own
    uncovered: float
    loss: float  # equation (1) of the mean of what followed at the NEIGHBOURS nearest


def steps(trajectories: list[Drive], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Inputs (count, 11) and transitions (count, 13) of steps evenly taken from trajectories."""
    states = torch.tensor(
        np.stack([t.states for t in trajectories]), dtype=torch.float64
    )
    actions = torch.tensor(
        np.stack([t.actions for t in trajectories]), dtype=torch.float64
    )
    inputs = encode_inputs(states[:, :-1], actions).reshape(-1, 11).numpy()
    targets = transition(states[:, :-1], states[:, 1:]).reshape(-1, 13).numpy()
    chosen = (
        np.linspace(0, len(inputs) - 1, min(count, len(inputs))).round().astype(int)
    )
    return inputs[chosen], targets[chosen]


def neighbourhoods(
    expert: tuple[np.ndarray, np.ndarray],
    novice: tuple[np.ndarray, np.ndarray],
    asked: tuple[np.ndarray, np.ndarray],
) -> dict[str, Neighbourhood]:
    """The expert's and the novice's, each from inputs (N, 11) and transitions (N, 13), to the steps that are asked."""
    scale = np.maximum(expert[0].std(axis=0), 1e-9)
    nearest, losses = {}, {}
    for role, (inputs, targets) in {"expert": expert, "novice": novice}.items():
        distances, found = cKDTree(inputs / scale).query(asked[0] / scale, k=NEIGHBOURS)
        nearest[role] = distances[:, 0]
        losses[role] = float(
            ((targets[found].mean(axis=1) - asked[1]) ** 2).sum(axis=1).mean()
        )
    limit = np.quantile(nearest["novice"], FAR)
    return {
        role: Neighbourhood(
            float(np.median(far)), float((far > limit).mean()), losses[role]
        )
        for role, far in nearest.items()
    }


def measure(study: Study, results: Path) -> None:
    """Measure both systems of a study and store what is found."""
    found: dict[str, dict[str, list[float]]] = {}
    for system in SYSTEMS:
        digests = study.digests(system)
        sets = study.preset.datasets(system)
        loaded = {
            kind: load_dataset(sets[kind], digests[f"{kind}_data"], study.data)
            for kind in sets
        }
        count = min(MOST, *(STEPS * len(loaded[kind]) for kind in ("expert", "novice")))
        expert, novice = (steps(loaded[kind], count) for kind in ("expert", "novice"))
        every = neighbourhoods(expert, novice, steps(loaded["validation"], QUERIES))
        found[system] = {
            role: [float(f"{x:.6g}") for x in one] for role, one in every.items()
        }
    made = {"preset": study.preset.name, "numerics": versions("simulation")}
    write_record(results / NAME, {**found, **made})


def read(results: Path | str) -> dict[str, dict[str, Neighbourhood]]:
    """What is stored, by system and robot; nothing where nothing is."""
    values = single(Path(results) / NAME)
    return {
        s: {role: Neighbourhood(*one) for role, one in values[s].items()}
        for s in SYSTEMS
        if s in values
    }


def make(study: Study, workers: int) -> None:
    """`companion run --figure overlap`, in one process."""
    measure(study, study.results)
