"""A model in training: everything that changes, and the single steps that Algorithms 1 and 2 are made of."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import torch
from torch import Tensor

from sidm.config import ConfigError
from sidm.learning import checkpoint
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.evaluation import mean_loss
from sidm.learning.evaluation import validation_loss as component_means
from sidm.learning.model import DynamicsModel
from sidm.learning.networks import Discriminator, seeded
from sidm.learning.sampler import Sampler
from sidm.learning.stopping import (
    SPACING,
    Components,
    EarlyStopping,
    Tested,
    TrainingError,
)
from sidm.learning.units import Standardisation, Units, units_of
from sidm.learning.weights import make_optimiser
from sidm.settings import Network, Training
from sidm.systems import ROLES

Progress = Callable[[Tested], None]  # called after each test


class Hook:
    """What a study adds to training; each method does nothing by default. `Training.hooks` gives a training's."""

    def sampler(
        self, datasets: Datasets, training: Training, seed: int, device: torch.device
    ) -> Sampler | None:
        """Another sampler than `sampler.Sampler`."""
        return None

    def begin(self, trainer: Trainer) -> None:
        """The trainer has its initial weights."""

    def auxiliary_loss(
        self, trainer: Trainer, latents: Mapping[str, Tensor]
    ) -> Tensor | None:
        """What is added to a batch's loss in Algorithm 1, from its latents (b, T, latent) by system: a scalar."""
        return None

    def after_step(self, trainer: Trainer) -> None:
        """The weights have taken a step of Algorithm 1."""

    def regularise(self, trainer: Trainer) -> bool:
        """A phase in the place of Algorithm 2; whether there is one."""
        return False

    def testing(self) -> contextlib.AbstractContextManager[None]:
        """Around each test."""
        return contextlib.nullcontext()

    def tensors(self) -> dict[str, Tensor]:
        """What a checkpoint has to keep, by name."""
        return {}

    def restore(self, tensors: Mapping[str, Tensor], updates: int) -> None:
        """Put back what `tensors` gave, after so many steps."""


class Trainer:
    """A model in training: weights, optimisers, batches, counters, the best weights so far.

    Args:
        datasets: what is learnt from and tested on.
        network: sizes of the networks.
        training: the settings.
        seed: of weights and batches.
        standardisation: units inside the networks, of all systems or of each; by
            default those of `units_of`.
        device: where to compute.
        start: initial weights; fresh ones by default.
        roles: the systems that the model has; by default the novice, and the expert
            where it is learnt from.
        model: the kind of model.
        sampler: what draws the batches.
        test_loss: the loss that training stops by, of a model on the test split; by
            default equation (1).
        measured: whether validation losses, and losses by component, are kept.

    Raises:
        ConfigError: the settings do not fit each other, or want data of the expert that
            are not there.
    """

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
        model: type[DynamicsModel] = DynamicsModel,
        sampler: Sampler | None = None,
        test_loss: Callable[[Any, Windows], float] = mean_loss,
        measured: bool = True,
    ):
        if training.regularise and network.own == "none":
            raise ConfigError(
                "Network.own='none' leaves one encoder, with nothing to match: regularise=False"
            )
        if training.needs_expert and datasets.expert is None:
            raise ConfigError(
                "p_expert above 0 and regularise need the expert's data, but datasets.expert is None"
            )
        roles = tuple(roles) or (ROLES if training.needs_expert else ("novice",))
        for role in roles:
            training.refuse_for(network.body(role))
        if training.units == "raw":
            standardisation = {
                role: Standardisation.none(network.body(role)) for role in roles
            }
        elif standardisation is None:
            standardisation = units_of(datasets, network)
        self.datasets, self.network, self.training, self.seed = (
            datasets,
            network,
            training,
            seed,
        )
        self.device, self.hooks = torch.device(device), training.hooks()
        self.units = checkpoint.digest(_tensors(standardisation))
        self.start = start and checkpoint.digest(start.values())
        self.test = datasets.test.first(training.test_trajectories)
        self.validation = datasets.validation.first(
            training.validation_trajectories if measured else 0
        )
        self.measured, self._test_loss = measured, test_loss
        self.model = model(network, standardisation, seed, roles).to(self.device)
        if start is not None:
            self.model.start(start)
        self.model.sidm.requires_grad_(training.frozen != "sidm")
        self.discriminator = seeded(
            seed, "discriminator", lambda: Discriminator(network)
        ).to(self.device)
        self.prediction = make_optimiser(self.model, training)
        self.discrimination = make_optimiser(self.discriminator, training)
        own = training.matching_optimiser == "own" and "novice" in self.model.encoders
        self.matching = (
            make_optimiser(self.model.encoders["novice"], training)
            if own
            else self.prediction
        )
        made = (
            hook.sampler(datasets, training, seed, self.device) for hook in self.hooks
        )
        self.sampler = (
            sampler
            or next(filter(None, made), None)
            or Sampler(datasets, training, seed, self.device)
        )
        self.stopping = EarlyStopping(
            training.stopping,
            training.smoothing,
            training.patience,
            training.max_samples,
        )
        self.best = self.weights()
        self.history: list[Tested] = []
        self.components: list[Components] = []
        self.iteration = self.samples = 0  # of the prediction phases
        self.accuracy: float | None = None  # of the discriminator
        # since the last test: sum of losses and their number, by system
        self.losses = dict.fromkeys(ROLES, (0.0, 0))
        for hook in self.hooks:
            hook.begin(self)

    @property
    def finished(self) -> bool:
        """Whether training ends here."""
        return self.stopping.finished(self.samples, self.iteration)

    def weights(self) -> dict[str, Tensor]:
        """A copy of the model's weights and buffers by name, in their shapes."""
        return {
            name: tensor.clone()
            for name, tensor in checkpoint.module_tensors(self.model).items()
        }

    def encode(self, role: str, windows: Windows) -> Tensor:
        """Latent state-actions (b, T, latent), float32, computed in the training's precision."""
        low = self.training.precision == "bfloat16"
        with torch.autocast(self.device.type, torch.bfloat16, enabled=low):
            return self.model.encode(role, windows)

    def step_prediction(self, loss: Tensor, latents: Mapping[str, Tensor]) -> None:
        """One step of the parts that a batch touched, down the gradient of its `loss` (Algorithm 1)."""
        self._clear_gradients()
        for hook in self.hooks:
            added = hook.auxiliary_loss(self, latents)
            loss = loss if added is None else loss + added
        loss.backward()
        self.prediction.step()
        for hook in self.hooks:
            hook.after_step(self)

    def step_discriminator(self, loss: Tensor) -> None:
        """One step of A alone down the gradient of `loss` (Algorithm 2)."""
        self.discrimination.zero_grad()
        loss.backward()
        self.discrimination.step()

    def step_encoder(self, loss: Tensor) -> None:
        """One step of E_n alone down the gradient of `loss` (Algorithm 2)."""
        # of all parts, since a shared optimiser steps those that have one
        self._clear_gradients()
        loss.backward(inputs=list(self.model.encoders["novice"].parameters()))
        self.matching.step()

    def _clear_gradients(self) -> None:
        """Begin a step of prediction or matching: no part has a gradient, or each that had one has 0."""
        self.prediction.zero_grad(set_to_none=not self.training.zero_gradients)

    def discriminate(self, latents: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """Logits (b, T) that A gives latents (b, T, latent), by '<system>_logits'; notes how many A tells apart."""
        logits = {role: self.discriminator.logits(one) for role, one in latents.items()}
        right = [
            one.flatten() > 0 if role == "expert" else one.flatten() < 0
            for role, one in logits.items()
        ]
        self.accuracy = float(torch.cat(right).float().mean())
        return {f"{role}_logits": one for role, one in logits.items()}

    def note(self, losses: Mapping[str, Tensor]) -> None:
        """Count an iteration of prediction with per-sample `losses` (b, T) by system."""
        if self.sampler.one_curve:
            losses = {"novice": torch.cat(list(losses.values()))}
        self.count({role: loss.numel() for role, loss in losses.items()})
        for role, loss in losses.items():
            self.add_losses(role, float(loss.detach().double().sum()))

    def count(self, samples: Mapping[str, int]) -> None:
        """Count an iteration of prediction with so many samples by system."""
        self.iteration += 1
        for role, number in samples.items():
            self.samples += number
            self.losses[role] = (self.losses[role][0], self.losses[role][1] + number)

    def add_losses(self, role: str, total: float) -> None:
        """Remember a sum of losses of counted samples until the next test."""
        self.losses[role] = (self.losses[role][0] + total, self.losses[role][1])

    @property
    def test_is_due(self) -> bool:
        """Whether a test follows this iteration."""
        return self.iteration % self.training.test_interval == 0

    def take_test(self, progress: Progress | None = None) -> Tested:
        """Measure the test loss; keep the weights if its smoothed value is the lowest so far."""
        with contextlib.ExitStack() as stack:
            for hook in self.hooks:
                stack.enter_context(hook.testing())
            validation = (
                mean_loss(self.model, self.validation) if len(self.validation) else None
            )
            if self.add_test(self._test_loss(self.model, self.test), validation):
                self.best = self.weights()
            if len(self.validation) and self.components_due:
                self.components.append(self.measure())
        if progress is not None:
            progress(self.history[-1])
        return self.history[-1]

    @property
    def components_due(self) -> bool:
        """Whether losses by component are to be kept of this test."""
        return (
            not self.components or self.samples >= SPACING * self.components[-1].samples
        )

    def measure(self) -> Components:
        """The loss by component of the weights as they are now."""
        test, validation = (
            component_means(self.model, windows).tolist()
            for windows in (self.test, self.validation)
        )
        return Components(self.samples, tuple(test), tuple(validation))

    def add_test(self, test_loss: float, validation_loss: float | None = None) -> bool:
        """Add a test to the learning curve; whether its smoothed test loss is the lowest so far.

        Raises:
            TrainingError: the test or the training loss is not finite; the test is not
                added.
        """
        novice, everything = (
            self.losses["novice"],
            tuple(map(sum, zip(*self.losses.values(), strict=True))),
        )
        total, count = novice if novice[1] else everything
        self.losses = dict.fromkeys(ROLES, (0.0, 0))
        tested = Tested(
            self.samples,
            total / max(count, 1),
            test_loss,
            self.accuracy,
            validation_loss,
        )
        for what, loss in (("training", tested.training_loss), ("test", test_loss)):
            if not math.isfinite(loss):
                raise TrainingError(what, loss, self.iteration)
        self.history.append(tested)
        return self.stopping.update(
            self.samples, self.iteration, tested.training_loss, test_loss
        )

    def optimisers(self) -> dict[str, torch.optim.Optimizer]:
        """The optimisers, by the phase that steps them."""
        found = {"prediction": self.prediction, "discrimination": self.discrimination}
        return (
            found
            if self.matching is self.prediction
            else found | {"matching": self.matching}
        )


def _tensors(units: Units) -> list[Tensor]:
    """All numbers of the units, system by system."""
    return (
        [*units]
        if isinstance(units, Standardisation)
        else [one for role in sorted(units) for one in units[role]]
    )
