"""Pretrained weights on disk: those of one system, seed and training serve trials of every novice dataset size."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable
from pathlib import Path

from companion.numerics import numbered
from companion.trials import Trial, without_later
from sidm.config import to_mapping
from sidm.learning.dataset import Datasets
from sidm.learning.networks import Network
from sidm.learning.training import Trained, train
from sidm.rivals import fine_tuning
from sidm.rivals.fine_tuning import Start, expert_in_place, start_from
from sidm.storage import locked


def folder(trial: Trial, data: str | Path, kind: str = "training") -> Path:
    """Where the weights that a trial starts from are kept, apart for each version of the numbers."""
    made_from = {
        "dataset": trial.datasets["expert"].name,
        "digest": trial.digests["expert"],
        "network": {
            name: one
            for name, one in to_mapping(network_of(trial)).items()
            if one is not None
        },
        "training": without_later(to_mapping(trial.pretraining)),
        "seed": trial.seed,
    }
    key = hashlib.sha256(json.dumps(made_from, sort_keys=True).encode()).hexdigest()[
        :20
    ]
    return Path(data) / "pretrained" / f"{key}-{numbered(kind)}"


def network_of(trial: Trial) -> Network:
    """That of a trial's pretraining, in which the expert is alone, in the novice's place, and shares nothing."""
    return dataclasses.replace(
        trial.network, own="all", novice_body=trial.network.expert_body
    )  # type: ignore


def start_of(
    trial: Trial, datasets: Datasets, data: str | Path, device: str = "cpu"
) -> Start | None:
    """The weights that a trial starts from, read or, where they lack, made; None for a trial that begins afresh.

    Raises:
        TrainingError: a loss of the pretraining is not finite.
        CheckpointError: the kept weights, or an unfinished pretraining's state, are
            damaged.
    """
    if trial.pretraining is None:
        return None
    sets, how = (
        expert_in_place(datasets, trial.seed),
        (network_of(trial), trial.pretraining, trial.seed),
    )
    return carried(
        trial,
        kept(
            folder(trial, data),
            lambda state: train(sets, *how, checkpoint=state, device=device),
        ),
    )


def kept(where: Path, trained: Callable[[Path], Trained]) -> Start:
    """The weights in a folder; where they lack, those of what is `trained` with its state kept in the folder named."""
    with locked(where):
        found = fine_tuning.read(where)
        if found is None:
            found = start_from(trained(where / fine_tuning.STATE))
            fine_tuning.keep(where, found)
        return found


def carried(trial: Trial, start: Start) -> Start:
    """What a trial takes of a pretraining's weights."""
    return start.core() if trial.pretrained == "sidm" else start
