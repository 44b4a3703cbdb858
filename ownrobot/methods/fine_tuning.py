"""Pretraining: weights that are trained on the expert alone, as a novice's start.

The same training loop gets the expert's trajectories in place of the novice's: three
quarters as the training split, one quarter as the test split, which ends training.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from torch import Tensor

from sidm.config import ConfigError
from sidm.learning import checkpoint
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.model import DynamicsModel
from sidm.learning.training import Trained
from sidm.learning.units import Standardisation
from sidm.settings import Network
from sidm.shards import split_indices

#: Folder of an unfinished pretraining's state, inside the folder of its weights.
STATE = "state"


class Pretrained(NamedTuple):
    """The weights of a model that has the novice's parts alone, by name.

    `samples` is how many samples of the expert the pretraining used.
    """

    weights: Mapping[str, Tensor]
    samples: int

    def core(self) -> Pretrained:
        """The weights of the shared SIDM alone.

        A novice that starts from them has a new encoder and a new decoder.
        """
        items = self.weights.items()
        core = {name: weight for name, weight in items if name.startswith("sidm.")}
        return self._replace(weights=core)


def expert_of(datasets: Datasets) -> Windows:
    """The expert's windows; ConfigError without any."""
    if datasets.expert is None:
        raise ConfigError(
            "this method needs the expert's data, but datasets.expert is None"
        )
    return datasets.expert


def pretraining_datasets(datasets: Datasets, seed: int) -> Datasets:
    """Datasets of a pretraining: the expert's in the novice's place.

    The validation set is empty: nothing evaluates these weights by themselves.
    """
    expert = expert_of(datasets)
    if len(expert) < 2:
        raise ConfigError(
            "the expert's motion is one piece; pretraining needs one to learn from "
            "and one to stop by"
        )
    train_rows, test_rows = split_indices(len(expert), len(expert), seed)
    test = expert.subset(test_rows)
    return Datasets(expert.subset(train_rows), test, test.first(0), expert)


def pretrained_from(trained: Trained) -> Pretrained:
    """The pretrained weights from a training on `pretraining_datasets`."""
    return Pretrained(trained.model.state_dict(), trained.samples)


def write(folder: Path, start: Pretrained) -> None:
    """Write pretrained weights to a folder, and delete the unfinished state there."""
    checkpoint.write(folder, start.weights, {"samples": start.samples})
    shutil.rmtree(folder / STATE, ignore_errors=True)


def read(folder: Path) -> Pretrained | None:
    """The pretrained weights in a folder; None where there are none."""
    content = checkpoint.read(folder)
    if content is None:
        return None
    weights, values = content
    return Pretrained(weights, values["samples"])


def frozen_model(
    network: Network, start: Pretrained, units: Standardisation
) -> DynamicsModel:
    """The expert's pretrained model in the novice's place, with fixed weights."""
    base = DynamicsModel(network, units, roles=["novice"])
    base.initialise_from(start.weights)
    return base.eval().requires_grad_(False)
