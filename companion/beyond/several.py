"""One SIDM of several experts, before any novice is met (section 6 of the paper).

Each expert has an encoder and a decoder of its own, as in Figure 1; Algorithm 1 draws each trajectory of a batch from
one of them at random. Algorithm 2 has no form for several experts in the paper and is left out.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from sidm.config import ConfigError
from sidm.learning import checkpoint
from sidm.learning.dataset import Datasets, Windows, split
from sidm.learning.evaluation import mean_loss
from sidm.learning.learner import Learner
from sidm.learning.model import DynamicsModel
from sidm.learning.seeds import generator
from sidm.learning.training import Trained, learn
from sidm.learning.units import Standardisation
from sidm.settings import Network, Training

Parts = Mapping[str, Tensor]  # weights and buffers by name


class SeveralLearner(Learner):
    """A model of several experts in training: each has three of four trajectories to learn from, one to stop by.

    Raises:
        ConfigError: settings with a novice.
    """

    measured = False

    def __init__(
        self,
        experts: Mapping[str, Windows],
        network: Network,
        training: Training,
        seed: int,
        standardisation: Standardisation,
    ):
        if training.needs_expert or training.mirror:
            raise ConfigError("several experts without a novice: p_expert=0, regularise=False and mirror=False")
        parts = {role: split(len(motion), len(motion), seed) for role, motion in experts.items()}
        self.learning = {role: experts[role].subset(learning) for role, (learning, _) in parts.items()}
        count = training.test_trajectories
        self.testing = {role: experts[role].subset(testing).first(count) for role, (_, testing) in parts.items()}
        first = next(iter(experts))
        sets = Datasets(self.learning[first], self.testing[first], experts[first])
        super().__init__(sets, network, training, seed, standardisation, roles=experts)
        self.generators |= {role: generator(seed, role) for role in experts}

    def part(self, role: str) -> Windows:
        """The trajectories of an expert to learn from."""
        return self.learning[role]

    def draw_batch_indices(self) -> dict[str, Tensor]:
        """Which trajectories (b,) make a batch, by expert: each of one that is drawn with equal probability."""
        roles, count = list(self.learning), self.training.batch
        whose = torch.randint(len(roles), (count,), generator=self.generators["system"])
        drawn = {role: self.draw_indices(role, count, role)[whose == number] for number, role in enumerate(roles)}
        return {role: indices for role, indices in drawn.items() if len(indices)}

    def note(self, losses: dict[str, Tensor]) -> None:
        """Count an iteration; all experts' losses, (b, T) each, make one learning curve."""
        super().note({"novice": torch.cat(list(losses.values()))})

    def test_loss(self) -> float:
        """The mean of the experts' test losses."""
        losses = [mean_loss(self.model, motion, role) for role, motion in self.testing.items()]
        return sum(losses) / len(losses)


def train_several(
    experts: Mapping[str, Windows], network: Network, training: Training, seed: int, standardisation: Standardisation
) -> Trained:
    """Train one SIDM, and an encoder and a decoder for each expert, by Algorithm 1 until their test loss rises.

    Args:
        experts: motion by name.
        network: sizes of the networks.
        training: settings, without a novice: p_expert=0 and regularise=False.
        seed: of the splits, the initial weights and the batches.
        standardisation: units inside the networks.

    Raises:
        ConfigError: settings with a novice.
        TrainingError: a test found a loss that is not finite.
    """
    return learn(SeveralLearner(experts, network, training, seed, standardisation))


def as_novice(model: DynamicsModel, role: str) -> Parts:
    """The SIDM with one expert's encoder and decoder in the novice's place."""
    found = {}
    for name, tensor in checkpoint.module_tensors(model).items():
        kind, _, rest = name.partition(".")
        if kind == "sidm":
            found[name] = tensor
        elif rest.startswith(f"{role}."):
            found[f"{kind}.novice.{rest.removeprefix(f'{role}.')}"] = tensor
    return found


def nearest(model: DynamicsModel, motion: Windows) -> str:
    """The expert whose encoder and decoder predict some motion of a novice with the smallest loss."""
    return min(model.encoders, key=lambda role: mean_loss(model, motion, role))


def fresh_around(model: DynamicsModel, network: Network, standardisation: Standardisation, seed: int) -> Parts:
    """The SIDM with a new encoder and a new decoder for the novice."""
    fresh = checkpoint.module_tensors(DynamicsModel(network, standardisation, seed, ["novice"]))
    sidm = {name: part for name, part in checkpoint.module_tensors(model).items() if name.startswith("sidm.")}
    return fresh | sidm
