"""Algorithms 1 and 2 with the negative log-likelihood as the loss of the prediction (section 3.2, last paragraph)."""

from __future__ import annotations

import torch
from torch import Tensor

from companion.beyond.distributions import DistributionModel
from sidm.config import ConfigError
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.evaluation import EVALUATION_BATCH
from sidm.learning.learner import Learner
from sidm.learning.seeds import generator
from sidm.learning.training import Trained, learn
from sidm.learning.units import Standardisation
from sidm.settings import Network, Training

#: Settings that have one value here.
ONLY = {
    "precision": "float32", "frozen": "nothing", "reduction": "sum", "stopping": "test_loss", "matching": "adversary",
    "own": "all",
}  # fmt: skip


class DistributionLearner(Learner):
    """A model of distributions in training; losses and tests are negative log-likelihoods, nats a sample.

    Raises:
        ConfigError: a setting that a likelihood does not know.
    """

    kind = DistributionModel
    measured = False
    model: DistributionModel

    def __init__(
        self, datasets: Datasets, network: Network, training: Training, seed: int, standardisation: Standardisation
    ):
        for name, only in ONLY.items():
            value = getattr(training, name, getattr(network, name, None))
            if value != only:
                raise ConfigError(f"training by likelihood has no {name}={value!r}, only {only!r}")
        super().__init__(datasets, network, training, seed, standardisation)
        self.noise = generator(seed, "latents")

    def encode(self, role: str, motion: Windows) -> Tensor:
        """A draw of latent state-actions (b, T, 128)."""
        return self.model.encode(role, motion.inputs, motion.maps, self.noise)

    def test_loss(self) -> float:
        """The negative log-likelihood of the test split."""
        return mean_nll(self.model, self.test)


def mean_nll(model: DistributionModel, motion: Windows) -> float:
    """Negative log-likelihood, nats, averaged over the steps of `motion`, all latents at their means."""
    total = 0.0
    with torch.inference_mode():
        for part in motion.split(EVALUATION_BATCH):
            found, _ = model.predict("novice", part.inputs, part.maps)
            total += float(found.nll(part.targets).double().sum())
    return total / motion.targets[..., 0].numel()


def train_distributions(
    datasets: Datasets, network: Network, training: Training, seed: int, standardisation: Standardisation
) -> Trained:
    """`training.train` for distributions: the same phases and the same rule to stop by, without checkpoints.

    The test likelihood that it stops by is that of the latents' means: the mixture over draws of them, which
    `particles.one_step` reports, costs as many times as much.

    Raises:
        ConfigError: data that the settings need are not there, or settings that it does not know.
        TrainingError: a test found a loss that is not finite; the message names the iteration.
    """
    return learn(DistributionLearner(datasets, network, training, seed, standardisation), losses_of=batch_nll)


def batch_nll(
    learner: DistributionLearner, batch: dict[str, Windows], latents: dict[str, Tensor]
) -> dict[str, Tensor]:
    """Negative log-likelihood of each sample of a batch and its latents by system, (b, T) each, as `batch_losses`."""
    model = learner.model
    transitions, _ = model.transit(torch.cat(list(latents.values())), generator=learner.noise)
    parts = transitions.split([len(motion) for motion in batch.values()])
    return {
        role: model.decoders[role].distribution(part).nll(motion.targets)  # type: ignore[operator]
        for (role, motion), part in zip(batch.items(), parts, strict=True)
    }
