"""Trained models, kept for what is done with them; the store of results keeps no weights."""

from __future__ import annotations

from pathlib import Path

from companion.engine.execute import perform
from companion.numerics import numbered
from companion.trials import Trial
from sidm.learning import checkpoint
from sidm.learning.model import DynamicsModel, Predictor


def predictor_of(trial: Trial, data: str | Path = "data") -> Predictor:
    """What a trial predicts the novice with: `model_of` it, or what it solves for, which is sooner made than kept."""
    return perform(trial, data)[1].model if trial.solved else model_of(trial, data)


def model_of(trial: Trial, data: str | Path = "data") -> DynamicsModel:
    """The network of a trial, its novice's parts alone; trained once and kept under `data`.

    Raises:
        CheckpointError: the kept weights are damaged.
        ShardError: data to train it are missing.
    """
    folder = Path(data) / "models" / f"{trial.key}-{numbered('training')}"
    kept = checkpoint.read(folder)
    if kept is None:
        weights = checkpoint.module_tensors(perform(trial, data)[1].model)
        checkpoint.write(
            folder,
            {name: part for name, part in weights.items() if ".expert." not in name},
            {},
        )
        kept = checkpoint.read(folder)
        assert kept is not None
    model = DynamicsModel(trial.network, roles=["novice"])
    model.start(kept[0])
    return model.eval()
