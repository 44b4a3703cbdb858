"""Pretraining: weights that learnt from the expert alone, for a novice to start from.

The expert's trajectories stand in the novice's place of the same training loop: three
of four to learn from, one of four to stop by.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from torch import Tensor

from sidm.config import ConfigError
from sidm.learning import checkpoint
from sidm.learning.dataset import Datasets, split
from sidm.learning.model import DynamicsModel
from sidm.learning.training import Trained
from sidm.learning.units import Standardisation
from sidm.settings import Network

STATE = "state"  # of an unfinished pretraining, a folder in that of its weights


class Start(NamedTuple):
    """What a pretraining leaves behind."""

    weights: Mapping[str, Tensor]  # of a model that has the novice's parts alone
    samples: int  # of the expert's, seen by it

    def core(self) -> Start:
        """The shared SIDM alone, for a novice whose encoder and decoder begin afresh."""
        return self._replace(
            weights={
                name: one
                for name, one in self.weights.items()
                if name.startswith("sidm.")
            }
        )


def expert_in_place(datasets: Datasets, seed: int) -> Datasets:
    """The expert's data in the novice's place, where nothing of the novice is left; ConfigError for fewer than two."""
    expert = datasets.expert
    if expert is None:
        raise ConfigError(
            "pretraining needs the expert's data, but datasets.expert is None"
        )
    if len(expert) < 2:
        raise ConfigError(
            "the expert's motion is one piece; pretraining needs one to learn from and one to stop by"
        )
    train_part, test_part = split(len(expert), len(expert), seed)
    testing = expert.subset(test_part)
    return Datasets(expert.subset(train_part), testing, testing, expert)


def start_from(trained: Trained) -> Start:
    """What a run on `expert_in_place` leaves to a novice."""
    return Start(checkpoint.module_tensors(trained.model), trained.samples)


def keep(folder: Path, start: Start) -> None:
    """Write it to a folder, and drop the state of the unfinished run there."""
    checkpoint.write(folder, start.weights, {"samples": start.samples})
    shutil.rmtree(folder / STATE, ignore_errors=True)


def read(folder: Path) -> Start | None:
    """What `keep` wrote, None where there is nothing; CheckpointError when it is damaged."""
    found = checkpoint.read(folder)
    return None if found is None else Start(found[0], found[1]["samples"])


def frozen(network: Network, start: Start, units: Standardisation) -> DynamicsModel:
    """The expert's model as pretrained, in the novice's place, frozen."""
    base = DynamicsModel(network, units, roles=["novice"])
    base.start(start.weights)
    return base.eval().requires_grad_(False)
