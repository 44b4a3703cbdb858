"""The motion that trials learn from, read from shards and checked by its digest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from companion.engine.datasets import load_dataset
from companion.trials import Dataset, Trial
from sidm.body import ROVER, Body
from sidm.drives import Drive
from sidm.learning.dataset import Datasets, Windows, load_windows, novice_split
from sidm.shards import simulated_ground
from sidm.systems import find_system


def load_checked(
    dataset: Dataset, digest: str, data: str | Path, pixels: int, body: Body = ROVER
) -> Windows:
    """Windows of a dataset.

    Raises:
        ShardError: the motion is missing, damaged, or has another digest.
    """
    load_dataset(dataset, digest, data)
    terrain = find_system(dataset.collection.system).terrain
    return load_windows(data, dataset.collection, dataset.count, terrain, pixels, body)


class Library:
    """The datasets of trials, each checked by the trial's digest and loaded once.

    Args:
        data: the folder of the shards.
    """

    def __init__(self, data: str | Path = "data"):
        self.data = Path(data)
        self._rollouts: dict[tuple, list[Drive]] = {}
        self._heights: dict[tuple, Tensor] = {}
        self._windows: dict[tuple, Windows] = {}

    def rollouts(self, trial: Trial) -> list[Drive]:
        """The drives of the 25-step test; ShardError as in `load_checked`."""
        key = trial.datasets["rollout"], trial.digests["rollout"]
        if key not in self._rollouts:
            self._rollouts[key] = load_dataset(*key, self.data)
        return self._rollouts[key]

    def rollout_heights(self, trial: Trial) -> Tensor:
        """Heights (B, H, W), m, of the ground of the drives of the 25-step test."""
        key = trial.datasets["rollout"], trial.digests["rollout"]
        if key not in self._heights:
            grounds = map(simulated_ground, self.rollouts(trial))
            self._heights[key] = torch.tensor(np.stack([g.heights for g in grounds]))
        return self._heights[key]

    def motion(self, trial: Trial, kind: str) -> Windows:
        """Windows of a trial's dataset; ShardError as in `load_checked`."""
        dataset, digest = trial.datasets[kind], trial.digests[kind]
        pixels, body = trial.network.pixels, trial.network.body(dataset.collection.role)
        key = dataset, digest, pixels, body
        if key not in self._windows:
            self._windows[key] = load_checked(dataset, digest, self.data, pixels, body)
        return self._windows[key]

    def datasets(self, trial: Trial) -> Datasets:
        """The novice's train and test split, validation and the expert's windows."""
        kinds = ("novice", "validation", "expert")
        pool, validation, expert = (self.motion(trial, kind) for kind in kinds)
        train, test = novice_split(len(pool), trial.novice_minutes, trial.seed)
        return Datasets(pool.subset(train), pool.subset(test), validation, expert)
