"""One SIDM of several experts, trained without a novice (section 6 of the paper).

Each expert has its own encoder and decoder, as in Figure 1. Algorithm 1 draws each
trajectory of a batch from a random expert. The paper gives no form of Algorithm 2 for
several experts, so Algorithm 2 is left out.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from sidm.config import ConfigError
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.evaluation import mean_loss
from sidm.learning.model import DynamicsModel
from sidm.learning.sampler import Sampler
from sidm.learning.seeds import generator
from sidm.learning.trainer import Trainer
from sidm.learning.units import Standardisation
from sidm.settings import Network, Training
from sidm.shards import split_indices

Weights = Mapping[str, Tensor]  # weights and buffers by name


class SeveralSampler(Sampler):
    """Draws from the windows of several experts with equal probability."""

    pool_curve_over_systems = True

    def __init__(
        self, windows: Mapping[str, Windows], training: Training, seed: int
    ) -> None:
        first = next(iter(windows.values()))
        super().__init__(Datasets(first, first, first), training, seed)
        self.windows = dict(windows)
        self.generators |= {role: generator(seed, role) for role in windows}

    def batch_indices(self) -> dict[str, Tensor]:
        """Indices of a batch's windows, (b,) by expert, for experts that have any."""
        roles, count = list(self.windows), self.training.batch
        source = self.generators["system"]
        expert = torch.randint(len(roles), (count,), generator=source)
        drawn = {
            role: self.indices(role, count, role)[expert == number]
            for number, role in enumerate(roles)
        }
        return {role: indices for role, indices in drawn.items() if len(indices)}


class SeveralTrainer(Trainer):
    """An SIDM, and an encoder and a decoder for each expert, in training.

    Three of four windows of each expert are for training, one is for the test loss:
    training stops when the mean of the experts' test losses rises. Settings with a
    novice, or with additions of studies, raise ConfigError.
    """

    def __init__(
        self,
        experts: Mapping[str, Windows],
        network: Network,
        training: Training,
        seed: int,
        standardisation: Standardisation,
    ) -> None:
        if training.needs_expert or not getattr(training, "plain", True):
            raise ConfigError(
                "several experts without a novice: p_expert=0, regularise=False and "
                "nothing that adds to it"
            )
        self.train: dict[str, Windows] = {}
        self.tests: dict[str, Windows] = {}
        for role, windows in experts.items():
            learn, test = split_indices(len(windows), len(windows), seed)
            self.train[role] = windows.subset(learn)
            self.tests[role] = windows.subset(test).first(training.test_trajectories)
        none = next(iter(experts.values())).first(0)  # there is no novice
        settings = network, training, seed, standardisation
        super().__init__(Datasets(none, none, none), *settings, roles=experts)

    def make_sampler(self) -> Sampler:
        """What draws each window from a random expert."""
        return SeveralSampler(self.train, self.training, self.seed)

    def test_loss(self) -> float:
        """The mean of the experts' test losses."""
        tests = self.tests.items()
        losses = [mean_loss(self.model, windows, role) for role, windows in tests]
        return sum(losses) / len(losses)


def expert_as_novice(model: DynamicsModel, role: str) -> Weights:
    """Weights of the SIDM, with an expert's encoder and decoder for the novice."""
    return {
        name.replace(f".{role}.", ".novice."): tensor
        for name, tensor in model.state_dict().items()
        if name.startswith("sidm.") or f".{role}." in name
    }


def nearest_expert(model: DynamicsModel, motion: Windows) -> str:
    """The expert whose encoder and decoder predict a novice's motion best."""
    return min(model.encoders, key=lambda role: mean_loss(model, motion, role))
