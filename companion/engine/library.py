"""The motion that trials learn from, read from shards once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from companion.engine.datasets import is_here
from companion.trials import Dataset, Trial
from sidm.body import ROVER, Body
from sidm.drives import Drive
from sidm.learning.dataset import Datasets, Windows, load_windows
from sidm.shards import Which, load, simulated_ground
from sidm.systems import find_system


def dataset_windows(
    dataset: Dataset,
    data: str | Path,
    pixels: int,
    body: Body = ROVER,
    which: Which | None = None,
) -> Windows:
    """Windows of a dataset, or of the trajectories `which` of it."""
    terrain = find_system(dataset.collection.system).terrain
    which = dataset.count if which is None else which
    return load_windows(data, dataset.collection, which, terrain, pixels, body)


class Library:
    """The datasets of trials, each loaded once."""

    def __init__(self, data: str | Path = "data"):
        self.data = Path(data)
        self._rollouts: dict[Dataset, list[Drive]] = {}
        self._heights: dict[Dataset, Tensor] = {}
        self._windows: dict[tuple, Windows] = {}

    def rollouts(self, trial: Trial) -> list[Drive]:
        """The drives of the 25-step test; ShardError as in `dataset_windows`."""
        dataset = trial.datasets["rollout"]
        if dataset not in self._rollouts:
            drives = load(self.data, dataset.collection, dataset.count)
            self._rollouts[dataset] = drives
        return self._rollouts[dataset]

    def rollout_heights(self, trial: Trial) -> Tensor:
        """Heights (B, H, W), m, of the ground of the drives of the 25-step test."""
        dataset = trial.datasets["rollout"]
        if dataset not in self._heights:
            grounds = map(simulated_ground, self.rollouts(trial))
            heights = torch.tensor(np.stack([ground.heights for ground in grounds]))
            self._heights[dataset] = heights
        return self._heights[dataset]

    def motion(
        self, trial: Trial, kind: str, which: Sequence[int] | None = None
    ) -> Windows:
        """Windows of a trial's dataset; ShardError as in `dataset_windows`."""
        dataset, pixels = trial.datasets[kind], trial.network.pixels
        body = trial.network.body(dataset.collection.role)
        key = dataset, pixels, body, None if which is None else tuple(which)
        if key not in self._windows:
            loaded = dataset_windows(dataset, self.data, pixels, body, which)
            self._windows[key] = loaded
        return self._windows[key]

    def datasets(self, trial: Trial) -> Datasets:
        """The novice's train and test split, validation and the expert's windows.

        A pool that is whole on disk is loaded whole, so that trials share its maps;
        otherwise the trial's own trajectories are.
        """
        train, test = trial.drawn
        which = None
        if not is_here(trial.datasets["novice"], self.data):
            which = np.sort(np.concatenate([train, test])).tolist()
            train, test = (np.searchsorted(which, part) for part in (train, test))
        pool = self.motion(trial, "novice", which)
        validation, expert = (self.motion(trial, k) for k in ("validation", "expert"))
        return Datasets(pool.subset(train), pool.subset(test), validation, expert)
