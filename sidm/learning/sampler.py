"""Random batches of windows that a training learns from."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from sidm.learning.dataset import Datasets, Windows
from sidm.learning.seeds import generator
from sidm.settings import Training

#: Purposes of random draws. Each has its own generator, so that one seed gives all
#: methods the same novice windows.
PURPOSES = (
    "system",
    "novice",
    "expert",
    "discriminator novice",
    "discriminator expert",
    "matching",
)
#: purpose of drawing the system of a discriminator's batch, if it has one system only
DISCRIMINATOR_SYSTEM = "discriminated system"


class Sampler:
    """Draws the batches of one training.

    Attributes:
        pool_curve_over_systems: whether the learning curve has the losses of all
            systems; otherwise it has the novice's.
    """

    pool_curve_over_systems = False

    def __init__(
        self,
        datasets: Datasets,
        training: Training,
        seed: int,
        device: str | torch.device = "cpu",
    ) -> None:
        self.training, self.device = training, torch.device(device)
        # by system
        self.windows: dict[str, Windows] = {"novice": datasets.train}
        if datasets.expert is not None:
            self.windows["expert"] = datasets.expert
        purposes = (*PURPOSES, DISCRIMINATOR_SYSTEM)
        self.generators = {purpose: generator(seed, purpose) for purpose in purposes}
        # draws without replacement: indices of the windows that come next, by system
        self.waiting: dict[str, Tensor] = {}

    def indices(self, role: str, count: int, purpose: str) -> Tensor:
        """Random indices (count,), int64, of a system's windows.

        Without `replacement` all purposes share one random order of the system's
        windows.
        """
        size = len(self.windows[role])
        if self.training.replacement:
            return torch.randint(size, (count,), generator=self.generators[purpose])
        waiting = self.waiting.get(role, torch.zeros(0, dtype=torch.long))
        while len(waiting) < count:
            order = torch.randperm(size, generator=self.generators[role])
            waiting = torch.cat([waiting, order])
        drawn, self.waiting[role] = waiting[:count], waiting[count:]
        return drawn

    def take(self, role: str, indices: Tensor) -> Windows:
        """The windows of a system at `indices` (B,), on the device."""
        return self.windows[role].take(indices).to(self.device)

    def draw(self, role: str, count: int, purpose: str) -> Windows:
        """`count` random windows of a system, on the device."""
        return self.take(role, self.indices(role, count, purpose))

    def batch_indices(self) -> dict[str, Tensor]:
        """Indices of the b_pred windows of a batch of Algorithm 1, by system.

        Each window is the expert's with probability p_e. With `replacement`, a novice
        and an expert index are drawn for every window and one is discarded: all methods
        thus see the same novice windows. Without it, only used indices are drawn.
        """
        indices, of_expert = (part[0] for part in self.batches(1))
        batch = {"novice": indices[~of_expert], "expert": indices[of_expert]}
        return {role: drawn for role, drawn in batch.items() if len(drawn)}

    def batches(self, iterations: int) -> tuple[Tensor, Tensor]:
        """Indices of the windows of several batches of Algorithm 1.

        Returns:
            Indices (iterations, b_pred) in the windows of each one's system, the
            novice's first, and which of them are the expert's: int64 and bool.
        """
        shape = iterations, self.training.batch
        draws = torch.rand(shape, generator=self.generators["system"])
        is_expert = draws < self.training.p_expert
        if self.training.system_draw == "iteration":
            is_expert = is_expert[:, :1].expand(shape)
        of_expert = is_expert.sort(dim=1).values
        batches = torch.zeros(shape, dtype=torch.long)
        places = {
            "novice": (~is_expert, ~of_expert),
            "expert": (is_expert, of_expert),
        }
        for role in self.windows:
            used, to = places[role]
            if self.training.replacement:
                batches[to] = self.indices(role, used.numel(), role)[used.flatten()]
            else:
                batches[to] = self.indices(role, int(used.sum()), role)
        return batches, of_expert

    def batch(self) -> dict[str, Windows]:
        """The windows of a batch of Algorithm 1, by system, on the device."""
        drawn = self.batch_indices().items()
        return {role: self.take(role, indices) for role, indices in drawn}

    def discriminator_systems(self) -> tuple[str, ...]:
        """The systems in a discriminator's batch, the expert first (Algorithm 2)."""
        if self.training.discriminator_draw == "both":
            return "expert", "novice"
        return ("expert",) if self.discriminated_systems(1) else ("novice",)

    def discriminated_systems(self, iterations: int) -> Tensor:
        """Whether batches of the discriminator with one system are the expert's."""
        source = self.generators[DISCRIMINATOR_SYSTEM]
        return torch.rand(iterations, generator=source) < 0.5

    def discriminator_batch(self) -> dict[str, Windows]:
        """b_d windows of each system, or of one, on the device (Algorithm 2)."""
        count = self.training.discriminator_batch
        return {
            role: self.draw(role, count, f"discriminator {role}")
            for role in self.discriminator_systems()
        }

    def matching_batch(self) -> Windows:
        """The novice's b_g windows for matching, on the device (Algorithm 2)."""
        return self.draw("novice", self.training.matching_batch, "matching")

    def state(self) -> dict[str, dict[str, Tensor]]:
        """Tensors that a checkpoint keeps, by group and name."""
        sources = self.generators.items()
        states = {purpose: source.get_state() for purpose, source in sources}
        return {"generators": states, "waiting": self.waiting}

    def restore(
        self, generators: Mapping[str, Tensor], waiting: Mapping[str, Tensor]
    ) -> None:
        """Continue from the groups of tensors that `state` gave."""
        for purpose, state in generators.items():
            self.generators[purpose].set_state(state)
        self.waiting = dict(waiting)
