"""The device's part of M trainers at once: weights, Adam states, best weights, losses.

The updates are those of `sidm.learning.training`: Algorithm 1 and the two halves of
Algorithm 2. A trajectory is named by its row in `DeviceData`. M trials, b trajectories
of T steps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor, nn

from companion.bundle.adam import Single, StackedAdam
from companion.bundle.cuda_graph import GraphedFunction
from companion.bundle.device_data import DeviceData
from companion.bundle.models import StackedModels, Systems, stacked, with_ndim, within
from sidm.learning.losses import matching_loss, prediction_loss
from sidm.learning.observation import TARGET_SIZE
from sidm.learning.trainer import Trainer
from sidm.systems import ROLES

KINDS = "encoders", "decoders"
NOVICE_ENCODER = "model.encoders.novice"


class StackedTrainers:
    """What M trainers keep and compute on the device.

    Attributes:
        predict: one iteration of Algorithm 1, see `_predict`
        discriminate: one update of the discriminators, see `_discriminate`
        match: one update of the novice's encoders, see `_match`
        test: sums of losses, see `_test`
        accuracy: (M,), share of latents that the discriminator told apart last
        matching_losses: (M,), sum of equation (4) over the matching iterations since
            the sum was set to 0
    """

    def __init__(
        self, trainers: Sequence[Trainer], data: DeviceData, device: torch.device
    ) -> None:
        self.trainers, self.data = trainers, data
        self.training, trials = trainers[0].training, len(trainers)
        self.models = StackedModels(trainers, device)
        # parts of the networks, those of the expert where a trial has them
        self.parts = [
            f"model.{name}"
            for name in ("sidm", *(f"{k}.{r}" for k in KINDS for r in ROLES))
            if self.models.parameters(f"model.{name}")
        ]
        self.best_weights = stacked([t.best_weights for t in trainers], device)
        self.prediction_optimiser = self._optimiser("model", "prediction")
        self.discrimination_optimiser = self._optimiser(
            "discriminator", "discrimination"
        )
        self.matching_optimiser = self.prediction_optimiser
        if self.training.matching_optimiser == "own":
            self.matching_optimiser = self._optimiser(NOVICE_ENCODER, "matching")
        # trials whose SIDM is not trained
        frozen = [trainer.training.frozen == "sidm" for trainer in trainers]
        self.frozen = torch.tensor(frozen, device=device)
        # sums of losses since the last test, by trial and role
        self.totals = torch.zeros(trials, 2, dtype=torch.float64, device=device)
        self.accuracy = torch.zeros(trials, device=device)
        self.matching_losses = torch.zeros(trials, device=device)
        pool = torch.cuda.graph_pool_handle() if device.type == "cuda" else None
        self.predict, self.discriminate, self.match, self.test = (
            GraphedFunction(function, device, pool)
            for function in (
                self._predict,
                self._discriminate,
                self._match,
                self._test,
            )
        )

    def _optimiser(self, part: str, phase: str) -> StackedAdam:
        """The optimisers of a phase, which step the parameters of a part."""
        singles = []
        for trainer in self.trainers:
            modules = nn.ModuleDict(
                {"model": trainer.model, "discriminator": trainer.discriminator}
            )
            trained = {
                name: parameter
                for name, parameter in modules.named_parameters()
                if name.startswith(f"{part}.") and parameter.requires_grad
            }
            singles.append(Single(getattr(trainer, f"{phase}_optimiser"), trained))
        return StackedAdam(self.models.parameters(part), singles)

    def hand_back(self, trial: int) -> None:
        """Copy a trial's state into its trainer, which can go on alone or be saved."""
        trainer = self.trainers[trial]
        for name in ("model", "discriminator"):
            module, weights = getattr(trainer, name), within(name, self.models.weights)
            own = {key: weights[key][trial] for key in module.state_dict()}
            module.load_state_dict(own)
        trainer.best_weights = {
            name: self.best_weights[name][trial].to("cpu", copy=True)
            for name in trainer.best_weights
        }
        for adam in {
            self.prediction_optimiser,
            self.discrimination_optimiser,
            self.matching_optimiser,
        }:
            adam.hand_back(trial)
        self.hand_over_losses(trial)

    def hand_over_losses(self, trial: int) -> None:
        """Add a trial's sums of losses to its trainer, and start them again from 0."""
        for role, total in zip(ROLES, self.totals[trial].tolist(), strict=True):
            self.trainers[trial].add_losses(role, total)
        self.totals[trial] = 0.0

    def _predict(self, active: Tensor, rows: Tensor, of_expert: Tensor) -> None:
        """One iteration of Algorithm 1.

        Args:
            active: (M,) bool, which trials take the step.
            rows: (M, b), the trajectories of each trial's batch.
            of_expert: (M, b) bool, which of them are the expert's.
        """
        losses = self._losses(rows, of_expert)
        # the gradient of a sum over trials is, in each trial, that of its own mean
        total = losses.mean((1, 2)).sum()
        if self.training.reduction == "mean":
            total = total / TARGET_SIZE
        # A system's own parts learn only where its trajectories were drawn.
        learning = {
            "novice": (~of_expert).any(1),
            "expert": of_expert.any(1),
            "sidm": ~self.frozen,
        }
        self._step_prediction(
            self._gradients(total, "model"),
            active,
            {part: learning[part.rpartition(".")[2]] for part in self.parts},
        )
        sums = losses.detach().double().sum(2)
        masks = (~of_expert, of_expert)
        by_role = torch.stack([torch.where(m, sums, 0.0).sum(1) for m in masks], dim=1)
        self.totals.add_(torch.where(active[:, None], by_role, 0.0))

    def _step_prediction(
        self,
        gradients: dict[str, Tensor],
        active: Tensor,
        learning: Mapping[str, Tensor],
    ) -> None:
        """One step of the prediction's optimiser, for the parts that learn.

        With `zero_gradients`, parts that have stepped before take a step as well.

        Args:
            gradients: (M, ...) each, by the parameter's name.
            active: (M,) bool, which trials take the step.
            learning: (M,) bool each, in which trials a part learns; a part that is
                not listed does not learn.
        """
        adam = self.prediction_optimiser
        for part in self.parts:
            steps = learning.get(part, torch.zeros_like(active))
            names = [name for name in adam.parameters if name.startswith(f"{part}.")]
            if self.training.zero_gradients:
                steps = steps | (adam.states[names[0]].step > 0)
                for name in names:
                    if name not in gradients:
                        gradients[name] = torch.zeros_like(adam.parameters[name])
            part_gradients = {n: gradients[n] for n in names if n in gradients}
            adam.step(part_gradients, active & steps)

    def _losses(self, rows: Tensor, of_expert: Tensor) -> Tensor:
        """Equation (1), (M, b, T), for the trajectories of a batch."""
        batch = self.data.windows.take(rows)
        has_expert = "model.encoders.expert" in self.parts
        systems = of_expert if has_expert else "novice"
        predicted = self.models.predict(systems, batch.inputs, batch.maps)
        return prediction_loss(predicted, batch.targets)

    def _discriminate(self, active: Tensor, rows: Tensor, of_expert: Tensor) -> None:
        """One update of the discriminator A alone, equation (2).

        With `discriminator_draw` 'both', half of the trajectories are the expert's;
        with 'one', all or none of a trial's.

        Args:
            active: (M,) bool, which trials take the step.
            rows: (M, b), the trajectories.
            of_expert: (M, b) bool, which of them are the expert's.
        """
        with torch.no_grad():
            latents = self._latents(of_expert, rows)
        logits = self.models.logits(latents)
        signed = torch.where(with_ndim(of_expert, logits.ndim), logits, -logits)
        # equation (2) is a sum over systems of means
        systems = 2 if self.training.discriminator_draw == "both" else 1
        loss = systems * matching_loss(signed).mean((1, 2)).sum()
        self.discrimination_optimiser.step(
            self._gradients(loss, "discriminator"), active
        )
        accuracy = (signed > 0).float().mean((1, 2))
        self.accuracy.copy_(torch.where(active, accuracy, self.accuracy))

    def _match(self, active: Tensor, rows: Tensor) -> None:
        """One update of the novice's encoder E_n alone, equation (4)."""
        logits = self.models.logits(self._latents("novice", rows))
        losses = matching_loss(logits).mean((1, 2))
        gradients = self._gradients(losses.sum(), NOVICE_ENCODER)
        self.matching_losses.add_(losses.detach())
        if self.matching_optimiser is self.prediction_optimiser:
            learning = {NOVICE_ENCODER: torch.ones_like(active)}
            self._step_prediction(gradients, active, learning)
        else:
            self.matching_optimiser.step(gradients, active)

    def _test(self, counted: Tensor, rows: Tensor) -> Tensor:
        """Sums of equation (1) over novice trajectories.

        Args:
            counted: (M, b) bool, which trajectories are summed.
            rows: (M, b), the trajectories.

        Returns:
            (M,) float64.
        """
        batch = self.data.windows.take(rows)
        with torch.no_grad():
            predicted = self.models.predict("novice", batch.inputs, batch.maps)
        losses = prediction_loss(predicted, batch.targets).double().sum(2)  # (M, b)
        return torch.where(counted, losses, 0.0).sum(1)

    def _latents(self, systems: Systems, rows: Tensor) -> Tensor:
        batch = self.data.windows.take(rows)
        return self.models.encode(systems, batch.inputs, batch.maps)

    def _gradients(self, loss: Tensor, part: str) -> dict[str, Tensor]:
        parameters = self.models.parameters(part)
        gradients = torch.autograd.grad(loss, list(parameters.values()))
        return dict(zip(parameters, gradients, strict=True))

    def close(self) -> None:
        """Free what the device holds for these trials; nothing works afterwards."""
        for function in (self.predict, self.discriminate, self.match, self.test):
            function.close()

    def keep_best(self, trials: Sequence[int]) -> None:
        """Copy the current weights of these trials as their best so far."""
        indices = torch.tensor(trials, dtype=torch.long, device=self.totals.device)
        for name, best in self.best_weights.items():
            best[indices] = self.models.weights[f"model.{name}"].detach()[indices]
