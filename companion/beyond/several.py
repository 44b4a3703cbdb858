"""One SIDM of several experts, before any novice is met (section 6 of the paper).

Each expert has an encoder and a decoder of its own, as in Figure 1; Algorithm 1 draws
each trajectory of a batch from one of them at random. Algorithm 2 has no form for
several experts in the paper and is left out.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from sidm.config import ConfigError
from sidm.learning import checkpoint
from sidm.learning.dataset import Datasets, Windows, split
from sidm.learning.evaluation import mean_loss
from sidm.learning.model import DynamicsModel
from sidm.learning.sampler import Sampler
from sidm.learning.seeds import generator
from sidm.learning.trainer import Trainer
from sidm.learning.training import Trained, learn
from sidm.learning.units import Standardisation
from sidm.settings import Network, Training

Parts = Mapping[str, Tensor]  # weights and buffers by name


class SeveralSampler(Sampler):
    """Draws from several experts, each with equal probability.

    Args:
        windows: to learn from, by expert.
        training: how batches are drawn.
        seed: of all draws.
    """

    one_curve = True

    def __init__(
        self, windows: Mapping[str, Windows], training: Training, seed: int
    ) -> None:
        first = next(iter(windows.values()))
        super().__init__(Datasets(first, first, first), training, seed)
        self.windows = dict(windows)
        self.generators |= {role: generator(seed, role) for role in windows}

    def batch_indices(self) -> dict[str, Tensor]:
        """Which windows (b,) make a batch, by expert: each of one that is drawn with equal probability."""
        roles, count = list(self.windows), self.training.batch
        whose = torch.randint(len(roles), (count,), generator=self.generators["system"])
        drawn = {
            role: self.indices(role, count, role)[whose == number]
            for number, role in enumerate(roles)
        }
        return {role: indices for role, indices in drawn.items() if len(indices)}


def several_trainer(
    experts: Mapping[str, Windows],
    network: Network,
    training: Training,
    seed: int,
    standardisation: Standardisation,
) -> Trainer:
    """A model of several experts in training: each has three of four windows to learn from, one to stop by.

    Raises:
        ConfigError: settings with a novice, or that add to the loop.
    """
    if training.needs_expert or training.hooks():
        raise ConfigError(
            "several experts without a novice: p_expert=0, regularise=False and nothing that adds to it"
        )
    parts = {
        role: split(len(windows), len(windows), seed)
        for role, windows in experts.items()
    }
    learning = {role: experts[role].subset(which) for role, (which, _) in parts.items()}
    count = training.test_trajectories
    testing = {
        role: experts[role].subset(which).first(count)
        for role, (_, which) in parts.items()
    }

    def test_loss(model: DynamicsModel, _: Windows) -> float:
        """The mean of the experts' test losses."""
        losses = [mean_loss(model, windows, role) for role, windows in testing.items()]
        return sum(losses) / len(losses)

    first = next(iter(experts))
    sets = Datasets(learning[first], testing[first], experts[first])
    sampler = SeveralSampler(learning, training, seed)
    return Trainer(
        sets,
        network,
        training,
        seed,
        standardisation,
        roles=experts,
        sampler=sampler,
        test_loss=test_loss,
        measured=False,
    )


def train_several(
    experts: Mapping[str, Windows],
    network: Network,
    training: Training,
    seed: int,
    standardisation: Standardisation,
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
    return learn(several_trainer(experts, network, training, seed, standardisation))


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


def fresh_around(
    model: DynamicsModel, network: Network, standardisation: Standardisation, seed: int
) -> Parts:
    """The SIDM with a new encoder and a new decoder for the novice."""
    fresh = checkpoint.module_tensors(
        DynamicsModel(network, standardisation, seed, ["novice"])
    )
    sidm = {
        name: part
        for name, part in checkpoint.module_tensors(model).items()
        if name.startswith("sidm.")
    }
    return fresh | sidm
