"""Trained models, kept in the folder of the data; the results have no weights."""

from __future__ import annotations

from pathlib import Path

from companion.engine.execute import perform
from companion.numerics import version_label
from companion.trials import Trial
from sidm.learning import checkpoint
from sidm.learning.model import DynamicsModel, Predictor


def predictor_of(trial: Trial, data: str | Path = "data") -> Predictor:
    """The model with which a trial predicts the novice.

    Networks are kept by `model_of`. Weights in closed form are solved again each time,
    which is faster than keeping them is worth.
    """
    return perform(trial, data)[1].model if trial.solved else model_of(trial, data)


def model_of(trial: Trial, data: str | Path = "data") -> DynamicsModel:
    """The novice's parts of a trial's network, trained once and kept under `data`."""
    folder = Path(data) / "models" / f"{trial.key}-{version_label('training')}"
    state = checkpoint.read(folder)
    if state is None:
        tensors = checkpoint.module_tensors(perform(trial, data)[1].model)
        novice = {name: t for name, t in tensors.items() if ".expert." not in name}
        checkpoint.write(folder, novice, {})
        state = checkpoint.read(folder)
        assert state is not None
    model = DynamicsModel(trial.network, roles=["novice"])
    model.initialise_from(state[0])
    return model.eval()
