"""Algorithms 1 and 2 with a negative log-likelihood as the prediction loss.

Section 3.2, last paragraph.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import torch
from torch import Tensor

from companion.extensions.distributions import DistributionModel
from sidm.config import ConfigError
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.evaluation import EVALUATION_BATCH
from sidm.learning.seeds import generator
from sidm.learning.trainer import Trainer
from sidm.learning.training import Trained, learn
from sidm.learning.units import Standardisation, Units
from sidm.settings import Network, Training

#: The only value that this training allows for a setting.
ONLY = {
    "precision": "float32",
    "frozen": "nothing",
    "reduction": "sum",
    "stopping": "test_loss",
    "matching": "adversary",
    "own": "all",
}


def mean_nll(model: DistributionModel, motion: Windows) -> float:
    """Mean negative log-likelihood of a step, nats, with all latents at their means."""
    total = 0.0
    with torch.inference_mode():
        for part in motion.split(EVALUATION_BATCH):
            prediction, _ = model.predict("novice", part.inputs, part.maps)
            total += float(prediction.nll(part.targets).sum(-1).double().sum())
    return total / motion.targets[..., 0].numel()


def train_distributions(
    datasets: Datasets,
    network: Network,
    training: Training,
    seed: int,
    standardisation: Standardisation,
) -> Trained:
    """Train a model of distributions, with the phases and the stopping of `train`.

    There are no checkpoints. The test loss is the likelihood at the means of the
    latents. The likelihood of the mixture over samples of the latents, which
    `particles.one_step` reports, costs as many times more as there are samples. Missing
    data and settings other than ONLY raise ConfigError; a loss that is not finite,
    TrainingError.
    """
    for name, only in ONLY.items():
        value = getattr(training, name, getattr(network, name, only))
        if value != only:
            raise ConfigError(
                f"training by likelihood has no {name}={value!r}, only {only!r}"
            )
    trainer = Trainer(
        datasets,
        network,
        training,
        seed,
        standardisation,
        model=LikelihoodModel,
        test_loss=mean_nll,
        with_validation=False,
    )
    return learn(trainer)


class LikelihoodModel(DistributionModel):
    """A model of distributions in training, with sampled latents; losses in nats."""

    def __init__(self, network: Network, units: Units, seed: int, roles: Iterable[str]):
        super().__init__(network, units, seed, roles)
        self.noise = generator(seed, "latents")

    def encode(self, role: str, batch: Windows) -> Tensor:
        """Sampled latent state-actions (b, T, latent)."""
        return self.draw_latents(role, batch.inputs, batch.maps, self.noise)

    def losses(
        self, batch: Mapping[str, Windows], latents: Mapping[str, Tensor]
    ) -> dict[str, Tensor]:
        """Negative log-likelihood of each step of a batch, nats, (b, T) by system."""
        transitions, _ = self.transit(
            torch.cat(list(latents.values())), generator=self.noise
        )
        parts = transitions.split([len(windows) for windows in batch.values()])
        return {
            role: self.decoders[role].distribution(part).nll(windows.targets).sum(-1)  # type: ignore[operator]
            for (role, windows), part in zip(batch.items(), parts, strict=True)
        }
