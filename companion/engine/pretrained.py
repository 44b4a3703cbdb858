"""Pretrained weights on disk.

The weights of one system, seed and training serve trials of every novice dataset size.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from companion.engine.datasets import digest_of
from companion.numerics import version_label
from companion.trials import Trial, without_later
from ownrobot.methods import fine_tuning
from ownrobot.methods.fine_tuning import (
    Pretrained,
    pretrained_from,
    pretraining_datasets,
)
from sidm.config import replace, to_mapping
from sidm.learning.dataset import Datasets
from sidm.learning.networks import Network
from sidm.learning.training import Trained, train
from sidm.storage import locked


def pretrained_folder(trial: Trial, data: str | Path, kind: str = "training") -> Path:
    """The folder of a trial's pretrained weights, for today's version of numbers."""
    expert = trial.datasets["expert"]
    made_from = {
        "dataset": expert.name,
        "digest": digest_of(expert, data),
        "seed": trial.seed,
    } | settings_of(network_of(trial), trial.pretraining)
    return weights_folder(data, made_from, kind)


def settings_of(network: Network, training: Any) -> dict[str, Any]:
    """The settings that weights depend on, without values of older versions."""
    sizes = to_mapping(network)
    return {
        "network": {name: value for name, value in sizes.items() if value is not None},
        "training": without_later(to_mapping(training)),
    }


def weights_folder(
    data: str | Path, made_from: Mapping[str, Any], kind: str, prefix: str = ""
) -> Path:
    """The folder of kept weights, named by all that they depend on."""
    text = json.dumps(made_from, sort_keys=True)
    key = hashlib.sha256(text.encode()).hexdigest()[:20]
    return Path(data) / "pretrained" / f"{prefix}{key}-{version_label(kind)}"


def network_of(trial: Trial) -> Network:
    """The network of a trial's pretraining: the expert has the role 'novice'."""
    body = trial.network.expert_body
    return replace(trial.network, own="all", novice_body=body)


def start_of(
    trial: Trial, datasets: Datasets, data: str | Path, device: str = "cpu"
) -> Pretrained | None:
    """The weights that a trial starts from; None for a trial that begins afresh.

    They are read from disk or, where they are missing, pretrained.
    """
    if trial.pretraining is None:
        return None
    sets = pretraining_datasets(datasets, trial.seed)
    settings = network_of(trial), trial.pretraining, trial.seed

    def pretrain(state: Path) -> Trained:
        return train(sets, *settings, checkpoint=state, device=device)

    folder = pretrained_folder(trial, data)
    return transferred(trial, load_or_pretrain(folder, pretrain))


def load_or_pretrain(path: Path, pretrain: Callable[[Path], Trained]) -> Pretrained:
    """The weights in a folder; where they are missing, `pretrain` makes them."""
    with locked(path):
        start = fine_tuning.read(path)
        if start is None:
            start = pretrained_from(pretrain(path / fine_tuning.STATE))
            fine_tuning.write(path, start)
        return start


def transferred(trial: Trial, start: Pretrained) -> Pretrained:
    """The part of pretrained weights that a trial starts from."""
    return start.core() if trial.pretrained == "sidm" else start
