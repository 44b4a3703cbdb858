"""A model in training: its state, and the single steps of Algorithms 1 and 2."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping

import torch
from torch import Tensor

from sidm.config import ConfigError
from sidm.learning import checkpoint
from sidm.learning.dataset import Datasets
from sidm.learning.evaluation import mean_loss
from sidm.learning.model import DynamicsModel
from sidm.learning.networks import Discriminator, seeded
from sidm.learning.sampler import Sampler
from sidm.learning.stopping import (
    CurvePoint,
    EarlyStopping,
    TrainingError,
)
from sidm.learning.units import Standardisation, Units, default_units
from sidm.learning.weights import make_optimiser
from sidm.settings import Network, Training
from sidm.systems import ROLES

Progress = Callable[[CurvePoint], None]  # called after each test


class Trainer:
    """A model in training: weights, optimisers, batches, counters and the best weights.

    The arguments are those of `training.train`, but for `roles`: the systems that the
    model has; by default the novice, and the expert where its data are needed. Studies
    override the methods from `make_sampler` to `restore_added`.
    """

    model_class = DynamicsModel

    def __init__(
        self,
        datasets: Datasets,
        network: Network,
        training: Training,
        seed: int,
        standardisation: Units | None = None,
        device: str | torch.device = "cpu",
        start: Mapping[str, Tensor] | None = None,
        roles: Iterable[str] = (),
    ):
        if training.regularise and network.own == "none":
            raise ConfigError(
                "Network.own='none' leaves one encoder, with nothing to match: "
                "regularise=False"
            )
        if training.needs_expert and datasets.expert is None:
            raise ConfigError(
                "p_expert above 0 and regularise need the expert's data, "
                "but datasets.expert is None"
            )
        roles = tuple(roles) or (ROLES if training.needs_expert else ("novice",))
        for role in roles:
            training.check_body(network.body(role))
        if training.units == "raw":
            standardisation = {
                role: Standardisation.none(network.body(role)) for role in roles
            }
        elif standardisation is None:
            standardisation = default_units(datasets, network)
        self.datasets, self.network = datasets, network
        self.training, self.seed = training, seed
        self.device = torch.device(device)
        self.units_digest = checkpoint.digest(_unit_tensors(standardisation))
        self.start_digest = None if start is None else checkpoint.digest(start.values())
        self.test = datasets.test.first(training.test_trajectories)
        self.validation = datasets.validation.first(training.validation_trajectories)
        model = self.model_class(network, standardisation, seed, roles)
        self.model = model.to(self.device)
        if start is not None:
            self.model.initialise_from(start)
        self.model.sidm.requires_grad_(training.frozen != "sidm")
        discriminator = seeded(seed, "discriminator", lambda: Discriminator(network))
        self.discriminator = discriminator.to(self.device)
        self.prediction_optimiser = make_optimiser(self.model, training)
        self.discrimination_optimiser = make_optimiser(self.discriminator, training)
        self.matching_optimiser = self.prediction_optimiser
        if training.matching_optimiser == "own" and "novice" in self.model.encoders:
            self.matching_optimiser = make_optimiser(
                self.model.encoders["novice"], training
            )
        self.sampler = self.make_sampler()
        self.stopping = EarlyStopping(
            training.stopping,
            training.smoothing,
            training.patience,
            training.max_samples,
        )
        self.best_weights = self.weights()
        self.history: list[CurvePoint] = []
        # iterations and samples of the prediction phases
        self.iteration = self.samples = 0
        self.accuracy: float | None = None  # accuracy of the discriminator
        self.matching_loss: float | None = None  # mean over the last matching
        # since the last test: sum of losses and their number, by system
        self.losses = dict.fromkeys(ROLES, (0.0, 0))

    def make_sampler(self) -> Sampler:
        """What draws the batches."""
        return Sampler(self.datasets, self.training, self.seed, self.device)

    def test_loss(self) -> float:
        """The loss that training stops by: equation (1) over the test split."""
        return mean_loss(self.model, self.test)

    def regularise(self) -> bool:
        """Run a phase in place of Algorithm 2, and say whether there was one: no."""
        return False

    def added_tensors(self) -> dict[str, Tensor]:
        """Tensors that a checkpoint keeps for a study, by name: none."""
        return {}

    def restore_added(self, tensors: Mapping[str, Tensor]) -> None:
        """Continue from the tensors that `added_tensors` gave."""

    @property
    def finished(self) -> bool:
        """Whether training ends now."""
        return self.stopping.finished(self.samples, self.iteration)

    def weights(self) -> dict[str, Tensor]:
        """A copy of the model's weights and buffers by name, in their shapes."""
        tensors = self.model.state_dict()
        return {name: tensor.clone() for name, tensor in tensors.items()}

    def step_prediction(self, loss: Tensor, latents: Mapping[str, Tensor]) -> None:
        """Take one step down the gradient of a batch's loss (Algorithm 1).

        Studies add losses of the batch's latents (B, T, latent), given by system.
        """
        self._clear_gradients()
        loss.backward()
        self.prediction_optimiser.step()

    def step_discriminator(self, loss: Tensor) -> None:
        """Take one step of A alone down the gradient of `loss` (Algorithm 2)."""
        self.discrimination_optimiser.zero_grad()
        loss.backward()
        self.discrimination_optimiser.step()

    def step_encoder(self, loss: Tensor) -> None:
        """Take one step of E_n alone down the gradient of `loss` (Algorithm 2)."""
        # clear the gradients of all parts, because a shared optimiser steps every part
        # that has a gradient
        self._clear_gradients()
        loss.backward(inputs=list(self.model.encoders["novice"].parameters()))
        self.matching_optimiser.step()

    def _clear_gradients(self) -> None:
        """Remove the gradients of all parts, or set them to 0 with `zero_gradients`."""
        self.prediction_optimiser.zero_grad(
            set_to_none=not self.training.zero_gradients
        )

    def discriminate(self, latents: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """Logits (B, T) of A by '<system>_logits', from latents (B, T, latent).

        The share that A classifies correctly is kept as `accuracy`.
        """
        logits, correct = {}, []
        for role, latent in latents.items():
            values = logits[f"{role}_logits"] = self.discriminator.logits(latent)
            correct.append((values > 0 if role == "expert" else values < 0).flatten())
        self.accuracy = float(torch.cat(correct).float().mean())
        return logits

    def record_losses(self, losses: Mapping[str, Tensor]) -> None:
        """Count an iteration of prediction, with a loss (B, T) per sample by system."""
        if self.sampler.pool_curve_over_systems:
            losses = {"novice": torch.cat(list(losses.values()))}
        self.count_samples({role: loss.numel() for role, loss in losses.items()})
        for role, loss in losses.items():
            self.add_losses(role, float(loss.detach().double().sum()))

    def count_samples(self, samples: Mapping[str, int]) -> None:
        """Count an iteration of prediction with so many samples, by system."""
        self.iteration += 1
        for role, number in samples.items():
            total, count = self.losses[role]
            self.losses[role] = total, count + number
            self.samples += number

    def add_losses(self, role: str, losses: float) -> None:
        """Add a sum of losses of counted samples to the mean until the next test."""
        total, count = self.losses[role]
        self.losses[role] = total + losses, count

    @property
    def test_is_due(self) -> bool:
        """Whether a test follows this iteration."""
        return self.iteration % self.training.test_interval == 0

    def run_test(self, progress: Progress | None = None) -> CurvePoint:
        """Measure the test loss; keep the weights if it is the lowest, smoothed."""
        validation = None
        if len(self.validation):
            validation = mean_loss(self.model, self.validation)
        if self.add_test(self.test_loss(), validation):
            self.best_weights = self.weights()
        if progress is not None:
            progress(self.history[-1])
        return self.history[-1]

    def add_test(self, test_loss: float, validation: float | None = None) -> bool:
        """Add a point to the learning curve; whether its smoothed loss is the lowest.

        A test or training loss that is not finite raises TrainingError instead.
        """
        total, count = self.losses["novice"]
        if not count:
            totals, counts = zip(*self.losses.values(), strict=True)
            total, count = sum(totals), sum(counts)
        self.losses = dict.fromkeys(ROLES, (0.0, 0))
        training_loss = total / max(count, 1)
        for kind, loss in (("training", training_loss), ("test", test_loss)):
            if not math.isfinite(loss):
                raise TrainingError(kind, loss, self.iteration)
        losses = training_loss, test_loss, self.accuracy, validation, self.matching_loss
        self.history.append(CurvePoint(self.samples, *losses))
        return self.stopping.update(
            self.samples, self.iteration, training_loss, test_loss
        )

    def optimisers(self) -> dict[str, torch.optim.Optimizer]:
        """The optimisers by the phase that uses them; a shared one appears once."""
        optimisers = {
            "prediction": self.prediction_optimiser,
            "discrimination": self.discrimination_optimiser,
        }
        if self.matching_optimiser is not self.prediction_optimiser:
            optimisers["matching"] = self.matching_optimiser
        return optimisers


def _unit_tensors(units: Units) -> list[Tensor]:
    """All tensors of the units, system by system."""
    if isinstance(units, Standardisation):
        return [*units]
    return [tensor for role in sorted(units) for tensor in units[role]]
