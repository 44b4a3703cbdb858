"""The device's part of M trainers at once: weights, Adam states, best weights, losses.

The updates are those of `sidm.learning.training`: Algorithm 1 and the two halves of
Algorithm 2. A trajectory is named by its row in its system's `DeviceData`. M trials, b
trajectories of T steps.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import torch
from torch import Tensor

from companion.bundle.adam import StackedAdam
from companion.bundle.cuda_graph import GraphedFunction
from companion.bundle.device_data import BLANK, DeviceData
from companion.bundle.models import StackedModels, with_ndim
from sidm.learning.losses import (
    component_losses,
    discriminator_loss,
    matching_loss,
    prediction_loss,
)
from sidm.learning.observation import TARGET_SIZE
from sidm.settings import Network, Training

NOVICE_ENCODER = "model.encoders.novice"


class StackedTrainers:
    """What M trainers of one Network keep and compute on the device.

    Args:
        data: trajectories on the device, by system.
        network: sizes of the networks.
        training: settings; the trials share those that `training.SHARED` names.
        roles: the systems: ('novice', 'expert') or ('novice',).
        trials: M.
        device: where to compute.

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
        self,
        data: Mapping[str, DeviceData],
        network: Network,
        training: Training,
        roles: Iterable[str],
        trials: int,
        device: torch.device,
    ):
        self.data, self.training, self.roles = data, training, tuple(roles)
        system_parts = [
            f"model.{kind}.{role}"
            for kind in ("encoders", "decoders")
            for role in self.roles
        ]
        self.parts = ["model.sidm", *system_parts]
        low = training.precision == "bfloat16"
        self.models = StackedModels(network, self.roles, trials, device, low)
        self.best_weights = {
            name: weights.detach().clone()
            for name, weights in self.models.weights.items()
            if name.startswith("model.")
        }
        self.prediction_optimiser = self._optimiser("model")
        self.discrimination_optimiser = self._optimiser("discriminator")
        own = training.matching_optimiser == "own"
        self.matching_optimiser = (
            self._optimiser(NOVICE_ENCODER) if own else self.prediction_optimiser
        )
        # trials whose SIDM is not trained
        self.frozen = torch.zeros(trials, dtype=torch.bool, device=device)
        # sums of losses since the last test, by trial and role
        self.totals = torch.zeros(trials, 2, dtype=torch.float64, device=device)
        self.accuracy = torch.zeros(trials, device=device)
        self.matching_losses = torch.zeros(trials, device=device)
        both = training.discriminator_draw == "both"
        discriminate = self._discriminate if both else self._discriminate_single_system
        pool = torch.cuda.graph_pool_handle() if device.type == "cuda" else None
        self.predict, self.discriminate, self.match, self.test = (
            GraphedFunction(function, device, pool)
            for function in (self._predict, discriminate, self._match, self._test)
        )

    def _optimiser(self, part: str) -> StackedAdam:
        decoupled = self.training.decay == "decoupled"
        return StackedAdam(self.models.parameters(part), decoupled)

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
        """Equation (1), (M, b, T), for the trajectories of a batch.

        Args:
            rows: (M, b), the trajectories.
            of_expert: (M, b) bool, which of them are the expert's.
        """
        if len(self.roles) > 1 and self.data["expert"] is self.data["novice"]:
            batch = self.data["novice"].windows.take(rows)
            predicted = self.models.predict(of_expert, batch.inputs, batch.maps)
            return prediction_loss(predicted, batch.targets)
        # Systems that differ in shapes or units each compute on all M b entries, with
        # blank trajectories in place of the other system's.
        rows_of = {
            role: torch.where(of_role, rows, BLANK)
            for role, of_role in zip(self.roles, (~of_expert, of_expert), strict=False)
        }
        latents = [self._latents(role, part) for role, part in rows_of.items()]
        transitions = self.models.transitions(select(of_expert, latents))
        targets = {
            role: self.data[role].windows.targets[part]
            for role, part in rows_of.items()
        }
        losses = []
        for role in targets:
            predicted = self.models.decode(role, transitions)
            weights = self.models.loss_weights(role)
            losses.append(prediction_loss(predicted, targets[role], weights))
        return select(of_expert, losses)

    def _discriminate(
        self, active: Tensor, expert_rows: Tensor, novice_rows: Tensor
    ) -> None:
        """One update of the discriminator A alone, equation (2).

        Args:
            active: (M,) bool, which trials take the step.
            expert_rows: (M, b), the expert's trajectories.
            novice_rows: (M, b), the novice's trajectories.
        """
        with torch.no_grad():
            expert_latents = self._latents("expert", expert_rows)
            novice_latents = self._latents("novice", novice_rows)
        expert = self.models.logits(expert_latents)
        novice = self.models.logits(novice_latents)
        loss = discriminator_loss(expert, novice).mean((1, 2)).sum()
        correct = torch.cat([expert > 0, novice < 0], dim=1)
        self._step_discriminator(loss, correct, active)

    def _discriminate_single_system(
        self, active: Tensor, rows: Tensor, of_expert: Tensor
    ) -> None:
        """One update of the discriminator A alone, on latents of a single system.

        Args:
            active: (M,) bool, which trials take the step.
            rows: (M, b), the trajectories.
            of_expert: (M,) bool, whether a trial's trajectories are the expert's.
        """
        of_expert = of_expert[:, None].expand_as(rows)
        expert_rows = torch.where(of_expert, rows, BLANK)
        novice_rows = torch.where(of_expert, BLANK, rows)
        with torch.no_grad():
            novice_latents = self._latents("novice", novice_rows)
            expert_latents = self._latents("expert", expert_rows)
            latents = select(of_expert, [novice_latents, expert_latents])
        logits = self.models.logits(latents)
        signed = torch.where(with_ndim(of_expert, logits.ndim), logits, -logits)
        loss = matching_loss(signed).mean((1, 2)).sum()
        self._step_discriminator(loss, signed > 0, active)

    def _step_discriminator(
        self, loss: Tensor, correct: Tensor, active: Tensor
    ) -> None:
        """Update A and note its accuracy.

        Args:
            loss: a scalar, the sum over trials.
            correct: (M, b, T) bool, which latents A told apart.
            active: (M,) bool, which trials take the step.
        """
        self.discrimination_optimiser.step(
            self._gradients(loss, "discriminator"), active
        )
        accuracy = correct.float().mean((1, 2))
        self.accuracy.copy_(torch.where(active, accuracy, self.accuracy))

    def _match(self, active: Tensor, rows: Tensor) -> None:
        """One update of the novice's encoder E_n alone, equation (4).

        Args:
            active: (M,) bool, which trials take the step.
            rows: (M, b), the novice's trajectories.
        """
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
        """Sums of equation (1) and of its summands over novice trajectories.

        Args:
            counted: (M, b) bool, which trajectories are summed.
            rows: (M, b), the trajectories.

        Returns:
            (M, 1 + Y) float64.
        """
        batch = self.data["novice"].windows.take(rows)
        with torch.no_grad():
            predicted = self.models.predict(
                "novice", batch.inputs, batch.maps, exact=True
            )
        weights = self.models.loss_weights("novice")
        terms = component_losses(predicted, batch.targets, weights)  # (M, b, T, Y)
        losses = torch.cat([terms.sum(-1, keepdim=True), terms], dim=-1).double().sum(2)
        return torch.where(counted[..., None], losses, 0.0).sum(1)

    def _latents(self, role: str, rows: Tensor) -> Tensor:
        batch = self.data[role].windows.take(rows)
        return self.models.encode(role, batch.inputs, batch.maps)

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
            best[indices] = self.models.weights[name].detach()[indices]


def select(of_expert: Tensor, by_role: Sequence[Tensor]) -> Tensor:
    """Entries (M, b, ...) of each trajectory's own system.

    Args:
        of_expert: (M, b) bool, which trajectories are the expert's.
        by_role: (M, b, ...) of the novice, then of the expert; or of the novice alone.
    """
    return torch.where(with_ndim(of_expert, by_role[0].ndim), by_role[-1], by_role[0])
