"""State of a trial between its own trainer and its slot among the stacked ones."""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import nn

from companion.bundle.adam import StackedAdam
from companion.bundle.models import tensors_of, within
from companion.bundle.trainers import NOVICE_ENCODER, StackedTrainers
from sidm.learning import checkpoint
from sidm.learning.trainer import Trainer
from sidm.systems import ROLES


def to_device(stacked: StackedTrainers, trial: int, trainer: Trainer) -> None:
    """Copy the state of `trainer` into slot `trial`."""
    modules = {"model": trainer.model, "discriminator": trainer.discriminator}
    stacked.models.put(trial, tensors_of(nn.ModuleDict(modules)))
    for name, best in stacked.best_weights.items():
        best[trial] = trainer.best_weights.get(
            name.removeprefix("model."), torch.zeros(())
        )
    settings = trainer.training
    stacked.frozen[trial] = settings.frozen == "sidm"
    stacked.totals[trial] = stacked.accuracy[trial] = 0.0
    for many, single, names in _optimisers(stacked, trainer):
        state = {}
        for path, tensor in checkpoint.optimiser_tensors(single).items():
            number, field = path.split("/")
            state[f"{names[int(number)]}/{field}"] = tensor
        many.put(trial, settings.learning_rate, settings.weight_decay, state)


def from_device(stacked: StackedTrainers, trial: int, trainer: Trainer) -> None:
    """Copy slot `trial` into `trainer`, which can then go on alone or be saved."""
    modules = {"model": trainer.model, "discriminator": trainer.discriminator}
    for name, module in modules.items():
        weights = within(name, stacked.models.weights)
        module.load_state_dict(
            {key: weights[key][trial] for key in module.state_dict()}
        )
    trainer.best_weights = {
        key: stacked.best_weights[f"model.{key}"][trial].to("cpu", copy=True)
        for key in trainer.best_weights
    }
    for many, single, names in _optimisers(stacked, trainer):
        state = {}
        for path, tensor in many.get(trial).items():
            name, field = path.split("/")
            if name in names:
                state[f"{names.index(name)}/{field}"] = tensor
        checkpoint.load_optimiser(single, state)
    hand_over_losses(stacked, trial, trainer)


def hand_over_losses(stacked: StackedTrainers, trial: int, trainer: Trainer) -> None:
    """Add a trial's sums of losses to `trainer`, and start them again from 0."""
    for role, total in zip(ROLES, stacked.totals[trial].tolist(), strict=True):
        trainer.add_losses(role, total)
    stacked.totals[trial] = 0.0


def _optimisers(
    stacked: StackedTrainers, trainer: Trainer
) -> Iterator[tuple[StackedAdam, torch.optim.Optimizer, list[str]]]:
    """Pairs of stacked and single optimiser.

    Yields:
        The stacked optimiser, the one of `trainer`, and the stacked names of the
        latter's parameters in their order.
    """
    model, discriminator = trainer.model, trainer.discriminator
    of_model = stacked.prediction_optimiser, trainer.prediction_optimiser
    of_discriminator = (
        stacked.discrimination_optimiser,
        trainer.discrimination_optimiser,
    )
    pairs: list[tuple[StackedAdam, torch.optim.Optimizer, str, nn.Module]] = [
        (*of_model, "model", model),
        (*of_discriminator, "discriminator", discriminator),
    ]
    if stacked.matching_optimiser is not stacked.prediction_optimiser:
        of_encoder = stacked.matching_optimiser, trainer.matching_optimiser
        pairs.append((*of_encoder, NOVICE_ENCODER, model.encoders["novice"]))
    for many, single, prefix, module in pairs:
        trained = (n for n, p in module.named_parameters() if p.requires_grad)
        yield many, single, [f"{prefix}.{name}" for name in trained]
