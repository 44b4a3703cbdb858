"""Batches: which windows a training learns from, one random generator a purpose."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from sidm.learning.dataset import Datasets, Windows
from sidm.learning.seeds import generator
from sidm.settings import Training
from sidm.systems import ROLES

#: What is drawn at random, each from a generator of its own, so that one seed gives all
#: methods the same novice draws.
PURPOSES = (
    "system",
    "novice",
    "expert",
    "discriminator novice",
    "discriminator expert",
    "matching",
)
#: whose latents a discriminator's batch has, where it has those of one
DISCRIMINATED = "discriminated system"


class Sampler:
    """Draws the batches of one training.

    Attributes:
        one_curve: whether the losses of all systems make one learning curve; else it is
            the novice's.

    Args:
        datasets: what is learnt from.
        training: how batches are drawn.
        seed: of all draws.
        device: where batches are wanted.
    """

    one_curve = False

    def __init__(
        self,
        datasets: Datasets,
        training: Training,
        seed: int,
        device: str | torch.device = "cpu",
    ) -> None:
        self.training, self.device = training, torch.device(device)
        # to learn from, by system
        self.windows: dict[str, Windows] = {"novice": datasets.train}
        if datasets.expert is not None:
            self.windows["expert"] = datasets.expert
        self.generators = {
            purpose: generator(seed, purpose) for purpose in (*PURPOSES, DISCRIMINATED)
        }
        # of draws without replacement: windows by system that come next
        self.waiting: dict[str, Tensor] = {}

    def indices(self, role: str, count: int, purpose: str) -> Tensor:
        """(count,) int64: which of a system's windows to learn from.

        Without `replacement` all purposes go through one order of the system's windows.
        """
        if self.training.replacement:
            return torch.randint(
                len(self.windows[role]), (count,), generator=self.generators[purpose]
            )
        return self._next_indices(role, count)

    def _next_indices(self, role: str, count: int) -> Tensor:
        """(count,) int64: those that come next in a system's random order; a new order begins where one ends."""
        waiting = self.waiting.get(role, torch.zeros(0, dtype=torch.long))
        while len(waiting) < count:
            order = torch.randperm(
                len(self.windows[role]), generator=self.generators[role]
            )
            waiting = torch.cat([waiting, order])
        drawn, self.waiting[role] = waiting[:count], waiting[count:]
        return drawn

    def take(self, role: str, which: Tensor) -> Windows:
        """A system's windows (b, T) numbered `which` (b,), on the device."""
        return self.windows[role].take(which).to(self.device)

    def draw(self, role: str, count: int, purpose: str) -> Windows:
        """`count` random windows of a system, on the device."""
        return self.take(role, self.indices(role, count, purpose))

    def batch_indices(self) -> dict[str, Tensor]:
        """Which b_pred windows (b,) make a batch, by system: each the expert's with probability p_e (Algorithm 1).

        Every place of the batch draws a novice's and an expert's window and takes one
        of them: the novice's is the same for all methods. Without `replacement` only
        what is taken is drawn.
        """
        count = self.training.batch
        of_expert = (
            torch.rand(count, generator=self.generators["system"])
            < self.training.p_expert
        )
        if self.training.system_draw == "iteration":
            of_expert = of_expert[:1].expand(count)
        chosen = {}
        for role, mine in zip(ROLES, (~of_expert, of_expert), strict=True):
            if role in self.windows:
                if self.training.replacement:
                    indices = self.indices(role, count, role)[mine]
                else:
                    indices = self.indices(role, int(mine.sum()), role)
                if len(indices):
                    chosen[role] = indices
        return chosen

    def batch(self) -> dict[str, Windows]:
        """The windows of a batch of Algorithm 1 by system, on the device."""
        return {
            role: self.take(role, which) for role, which in self.batch_indices().items()
        }

    def discriminated(self) -> tuple[str, ...]:
        """The systems whose latents a discriminator's batch has, the expert first (Algorithm 2)."""
        if self.training.discriminator_draw == "both":
            return "expert", "novice"
        of_expert = torch.rand(1, generator=self.generators[DISCRIMINATED]) < 0.5
        return ("expert",) if of_expert else ("novice",)

    def discriminator_batch(self) -> dict[str, Windows]:
        """b_d windows of each system, or of one of them, on the device (Algorithm 2)."""
        count = self.training.discriminator_batch
        return {
            role: self.draw(role, count, f"discriminator {role}")
            for role in self.discriminated()
        }

    def matching_batch(self) -> Windows:
        """b_g windows of the novice, on the device (Algorithm 2)."""
        return self.draw("novice", self.training.matching_batch, "matching")

    def state(self) -> dict[str, dict[str, Tensor]]:
        """What a checkpoint keeps, by group and name."""
        states = {purpose: one.get_state() for purpose, one in self.generators.items()}
        return {"generators": states, "waiting": self.waiting}

    def restore(
        self, generators: Mapping[str, Tensor], waiting: Mapping[str, Tensor]
    ) -> None:
        """Put back what `state` gave."""
        for purpose, state in generators.items():
            self.generators[purpose].set_state(state)
        self.waiting = dict(waiting)
