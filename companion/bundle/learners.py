"""What a `Trainer` changes on the device, for M of them at once: weights, moments, best weights, losses.

The updates are those of `training`: Algorithm 1 and the two halves of Algorithm 2.
Trajectories are named by their places on their system's `Shelf`. M trials, b
trajectories of T steps.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

import torch
from torch import Tensor, nn

from companion.bundle.adam import StackedAdam
from companion.bundle.recorded import Recorded
from companion.bundle.shelf import BLANK, Shelf
from companion.bundle.stack import Stack, tensors_of, trailing, within
from sidm.learning import checkpoint
from sidm.learning.losses import (
    component_losses,
    discriminator_loss,
    matching_loss,
    prediction_loss,
)
from sidm.learning.observation import TARGET_SIZE
from sidm.learning.trainer import Trainer
from sidm.settings import Network, Training
from sidm.systems import ROLES

NOVICE_ENCODER = "model.encoders.novice"


class StackedLearners:
    """M trials of one Network on one device."""

    def __init__(
        self,
        shelves: Mapping[str, Shelf],
        network: Network,
        training: Training,
        roles: Iterable[str],
        trials: int,
        device: torch.device,
    ):
        """Room for `trials` trials of these `roles`; of `training` they share what `bundle.SHARED` names."""
        self.shelves, self.training, self.roles = shelves, training, tuple(roles)
        systems = (
            f"model.{part}.{role}"
            for part in ("encoders", "decoders")
            for role in self.roles
        )
        self.parts = ["model.sidm", *systems]
        self.stack = Stack(
            network, self.roles, trials, device, low=training.precision == "bfloat16"
        )
        self.best = {
            n: one.detach().clone()
            for n, one in self.stack.weights.items()
            if n.startswith("model.")
        }
        decoupled = training.decay == "decoupled"
        self.prediction = StackedAdam(self.stack.learnt("model"), decoupled)
        self.discrimination = StackedAdam(self.stack.learnt("discriminator"), decoupled)
        own = training.matching_optimiser == "own"
        self.matching = (
            StackedAdam(self.stack.learnt(NOVICE_ENCODER), decoupled)
            if own
            else self.prediction
        )
        # whose SIDM stays as it is
        self.frozen = torch.zeros(trials, dtype=torch.bool, device=device)
        # of losses since a test, by role
        self.totals = torch.zeros(trials, 2, dtype=torch.float64, device=device)
        # share of latents that the discriminators told apart
        self.right = torch.zeros(trials, device=device)
        discriminate = (
            self._discriminate
            if training.discriminator_draw == "both"
            else self._discriminate_one
        )
        works = self._predict, discriminate, self._match, self._test
        pool = torch.cuda.graph_pool_handle() if device.type == "cuda" else None
        self.predict, self.discriminate, self.match, self.test = (
            Recorded(work, device, pool) for work in works
        )

    def _predict(self, moving: Tensor, places: Tensor, of_expert: Tensor) -> None:
        """An iteration of Algorithm 1 on the trajectories at `places` (M, b), the expert's where `of_expert`."""
        losses = self._losses(places, of_expert)
        # each trial's gradient is that of its own mean
        total = losses.mean((1, 2)).sum()
        gradients = self._gradients(
            total / TARGET_SIZE if self.training.reduction == "mean" else total, "model"
        )
        # A system's own parts only learn where its trajectories were drawn.
        learning = {
            "novice": (~of_expert).any(1),
            "expert": of_expert.any(1),
            "sidm": ~self.frozen,
        }
        self._step_prediction(
            gradients,
            moving,
            {part: learning[part.rpartition(".")[2]] for part in self.parts},
        )
        sums = losses.detach().double().sum(2)
        by_role = torch.stack(
            [torch.where(of, sums, 0.0).sum(1) for of in (~of_expert, of_expert)], dim=1
        )
        self.totals.add_(torch.where(moving[:, None], by_role, 0.0))

    def _step_prediction(
        self,
        gradients: dict[str, Tensor],
        moving: Tensor,
        learning: Mapping[str, Tensor],
    ) -> None:
        """A step of the parts that learn (M,); with `zero_gradients` of all that have stepped before, too."""
        for part in self.parts:
            now = learning.get(part, torch.zeros_like(moving))
            names = [
                name
                for name in self.prediction.parameters
                if name.startswith(f"{part}.")
            ]
            if self.training.zero_gradients:
                now = now | (self.prediction.moments[names[0]].step > 0)
                gradients |= {
                    n: torch.zeros_like(self.prediction.parameters[n])
                    for n in names
                    if n not in gradients
                }
            self.prediction.step(
                {name: gradients[name] for name in names if name in gradients},
                moving & now,
            )

    def _losses(self, places: Tensor, of_expert: Tensor) -> Tensor:
        """Equation (1), (M, b, T), of the trajectories at `places` (M, b), the expert's where `of_expert`."""
        if len(self.roles) > 1 and self.shelves["expert"] is self.shelves["novice"]:
            batch = self.shelves["novice"].motion.take(places)
            return prediction_loss(
                self.stack.predict(of_expert, batch.inputs, batch.maps), batch.targets
            )
        # Systems that differ in shapes or units compute on all places, on blanks where
        # the other's trajectory stands.
        own = {
            role: torch.where(mine, places, BLANK)
            for role, mine in zip(self.roles, (~of_expert, of_expert), strict=False)
        }
        transitions = self.stack.transitions(
            chosen(of_expert, [self._latents(role, at) for role, at in own.items()])
        )
        targets = {
            role: self.shelves[role].motion.targets[at] for role, at in own.items()
        }
        losses = (
            self._loss(role, self.stack.decode(role, transitions), one)
            for role, one in targets.items()
        )
        return chosen(of_expert, list(losses))

    def _loss(self, role: str, predicted: Tensor, targets: Tensor) -> Tensor:
        return prediction_loss(predicted, targets, self.stack.loss_weights(role))

    def _discriminate(
        self, moving: Tensor, expert_places: Tensor, novice_places: Tensor
    ) -> None:
        """One update of A alone, equation (2)."""
        with torch.no_grad():
            latents = [
                self._latents(role, at)
                for role, at in (("expert", expert_places), ("novice", novice_places))
            ]
        expert, novice = map(self.stack.logits, latents)
        loss = discriminator_loss(expert, novice).mean((1, 2)).sum()
        self._step_discriminator(
            loss, torch.cat([expert > 0, novice < 0], dim=1), moving
        )

    def _discriminate_one(
        self, moving: Tensor, places: Tensor, of_expert: Tensor
    ) -> None:
        """Update A alone on latents of a single system, the expert's in the trials `of_expert` (M,)."""
        mine = of_expert[:, None].expand_as(places)
        own = {
            "expert": torch.where(mine, places, BLANK),
            "novice": torch.where(mine, BLANK, places),
        }
        with torch.no_grad():
            latents = chosen(mine, [self._latents(role, own[role]) for role in ROLES])
        logits = self.stack.logits(latents)
        signed = torch.where(trailing(mine, logits.ndim), logits, -logits)
        self._step_discriminator(
            matching_loss(signed).mean((1, 2)).sum(), signed > 0, moving
        )

    def _step_discriminator(self, loss: Tensor, right: Tensor, moving: Tensor) -> None:
        """Update A by a loss, and note which of its latents (M, b, T) it told apart."""
        self.discrimination.step(self._gradients(loss, "discriminator"), moving)
        self.right.copy_(torch.where(moving, right.float().mean((1, 2)), self.right))

    def _match(self, moving: Tensor, places: Tensor) -> None:
        """One update of E_n alone, equation (4)."""
        loss = (
            matching_loss(self.stack.logits(self._latents("novice", places)))
            .mean((1, 2))
            .sum()
        )
        gradients = self._gradients(loss, NOVICE_ENCODER)
        if self.matching is self.prediction:
            self._step_prediction(
                gradients, moving, {NOVICE_ENCODER: torch.ones_like(moving)}
            )
        else:
            self.matching.step(gradients, moving)

    def _test(self, counted: Tensor, places: Tensor) -> Tensor:
        """Sums of equation (1), and of its summands, over the trajectories at `places` (M, b) that are `counted`.

        Returns:
            (M, 1 + Y) float64.
        """
        batch = self.shelves["novice"].motion.take(places)
        with torch.no_grad():
            predicted = self.stack.predict(
                "novice", batch.inputs, batch.maps, exact=True
            )
        # (M, b, T, Y)
        terms = component_losses(
            predicted, batch.targets, self.stack.loss_weights("novice")
        )
        losses = torch.cat([terms.sum(-1, keepdim=True), terms], dim=-1).double().sum(2)
        return torch.where(counted[..., None], losses, 0.0).sum(1)

    def _latents(self, role: str, places: Tensor) -> Tensor:
        batch = self.shelves[role].motion.take(places)
        return self.stack.encode(role, batch.inputs, batch.maps)

    def _gradients(self, loss: Tensor, part: str) -> dict[str, Tensor]:
        own = self.stack.learnt(part)
        return dict(
            zip(own, torch.autograd.grad(loss, list(own.values())), strict=True)
        )

    def close(self) -> None:
        """Free what the device holds for these trials; nothing can be computed any more."""
        for one in (self.predict, self.discriminate, self.match, self.test):
            one.close()

    def keep_best(self, trials: Sequence[int]) -> None:
        """The weights of these trials are the best so far."""
        chosen = torch.tensor(trials, dtype=torch.long, device=self.totals.device)
        for name, best in self.best.items():
            best[chosen] = self.stack.weights[name].detach()[chosen]

    def put(self, trial: int, trainer: Trainer) -> None:
        """Take over what `trainer` has learnt so far."""
        modules = nn.ModuleDict(
            {"model": trainer.model, "discriminator": trainer.discriminator}
        )
        self.stack.put(trial, tensors_of(modules))
        for name, best in self.best.items():
            best[trial] = trainer.best.get(name.removeprefix("model."), torch.zeros(()))
        self.frozen[trial] = trainer.training.frozen == "sidm"
        self.totals[trial] = self.right[trial] = 0.0
        for stacked, single, names in self._optimisers(trainer):
            state = {}
            for path, tensor in checkpoint.optimiser_tensors(single).items():
                number, what = path.split("/")
                state[f"{names[int(number)]}/{what}"] = tensor
            stacked.put(
                trial,
                trainer.training.learning_rate,
                trainer.training.weight_decay,
                state,
            )

    def get(self, trial: int, trainer: Trainer) -> None:
        """Give `trainer` what its trial has learnt, so that it can go on alone or be saved."""
        for name, module in (
            ("model", trainer.model),
            ("discriminator", trainer.discriminator),
        ):
            mine = within(name, self.stack.weights)
            module.load_state_dict(
                {key: mine[key][trial] for key in module.state_dict()}
            )
        trainer.best = {
            key: self.best[f"model.{key}"][trial].to("cpu", copy=True)
            for key in trainer.best
        }
        for stacked, single, names in self._optimisers(trainer):
            state = {}
            for path, tensor in stacked.get(trial).items():
                name, what = path.split("/")
                if name in names:
                    state[f"{names.index(name)}/{what}"] = tensor
            checkpoint.load_optimiser(single, state)
        self.settle(trial, trainer)

    def settle(self, trial: int, trainer: Trainer) -> None:
        """Give `trainer` the sums of its losses since the last time."""
        for role, total in zip(ROLES, self.totals[trial].tolist(), strict=True):
            trainer.add_losses(role, total)
        self.totals[trial] = 0.0

    def _optimisers(
        self, trainer: Trainer
    ) -> Iterator[tuple[StackedAdam, torch.optim.Optimizer, list[str]]]:
        """Stacked and single optimisers, and the names that the single one's parameters have in the stack."""
        pairs: list[tuple[StackedAdam, torch.optim.Optimizer, str, nn.Module]] = [
            (self.prediction, trainer.prediction, "model", trainer.model),
            (
                self.discrimination,
                trainer.discrimination,
                "discriminator",
                trainer.discriminator,
            ),
        ]
        if self.matching is not self.prediction:
            pairs.append(
                (
                    self.matching,
                    trainer.matching,
                    NOVICE_ENCODER,
                    trainer.model.encoders["novice"],
                )
            )
        for stacked, single, prefix, module in pairs:
            yield (
                stacked,
                single,
                [
                    f"{prefix}.{name}"
                    for name, one in module.named_parameters()
                    if one.requires_grad
                ],
            )


def chosen(of_expert: Tensor, by_role: Sequence[Tensor]) -> Tensor:
    """(M, b, ...) of the novice's and the expert's, where there is one, by whose trajectory stands at (M, b)."""
    return torch.where(trailing(of_expert, by_role[0].ndim), by_role[-1], by_role[0])
