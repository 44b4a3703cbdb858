"""Networks that estimate Gaussian distributions (section 3.2, last paragraph).

All distributions are diagonal Gaussians. Latent state-actions and latent state
transitions are sampled by reparametrisation (Kingma and Welling, 2014); the decoder
gives the mean and the standard deviation of the state transition. Without a random
generator, the means take the place of the samples. Algorithms 1 and 2 train such
networks with the negative log-likelihood as the prediction loss.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from sidm.config import ConfigError
from sidm.learning import seeds
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.evaluation import EVALUATION_BATCH
from sidm.learning.model import DynamicsModel
from sidm.learning.networks import SIDM, Decoder, Encoder, Memory
from sidm.learning.trainer import Trainer
from sidm.learning.training import Trained, learn
from sidm.learning.units import Standardisation, Units
from sidm.learning.weights import scale_last
from sidm.settings import Network, Training

#: Bounds of the logarithm of a standard deviation, in the networks' units.
MIN_LOG_STD, MAX_LOG_STD = -6.0, 2.0
#: Logarithm of the latents' standard deviation before training: about a twentieth of
#: what the latents vary by.
INITIAL_LOG_STD = -3.0
#: The only value that this training allows for a setting.
ONLY = {
    "precision": "float32",
    "frozen": "nothing",
    "reduction": "sum",
    "stopping": "test_loss",
    "matching": "adversary",
    "own": "all",
}


class Gaussian(NamedTuple):
    """Independent normal distributions."""

    mean: Tensor  # (...)
    std: Tensor  # (...)

    def sample(self, generator: torch.Generator | None) -> Tensor:
        """One sample of each distribution, (...); the means without a generator."""
        if generator is None:
            return self.mean
        shape, kind = self.mean.shape, self.mean.dtype
        noise = torch.randn(shape, generator=generator, dtype=kind)
        return self.mean + self.std * noise.to(self.mean.device)

    def nll(self, values: Tensor) -> Tensor:
        """Negative log-likelihood of each of values (..., K), nats."""
        squares = ((values - self.mean) / self.std).square()
        return squares / 2 + self.std.log() + math.log(2 * math.pi) / 2


class StdHead(nn.Module):
    """A linear layer from means of latents to standard deviations, equal at first."""

    def __init__(self, size: int):
        super().__init__()
        self.dense = nn.Linear(size, size)
        nn.init.zeros_(self.dense.weight)
        nn.init.constant_(self.dense.bias, INITIAL_LOG_STD)

    def forward(self, mean: Tensor) -> Gaussian:
        """Independent normal distributions about latents (..., K)."""
        return Gaussian(mean, self.dense(mean).clamp(MIN_LOG_STD, MAX_LOG_STD).exp())


class GaussianEncoder(Encoder):
    """E_e or E_n that estimates a distribution about the latents of an `Encoder`."""

    def __init__(self, network: Network, *units_and_body: Any):
        super().__init__(network, *units_and_body)
        self.spread = StdHead(network.latent)

    def distribution(self, inputs: Tensor, maps: Tensor) -> Gaussian:
        """Distribution of latent state-actions (B, T, 128)."""
        return self.spread(self(inputs, maps))


class GaussianSIDM(SIDM):
    """The SIDM that estimates a distribution about the transitions of an `SIDM`."""

    def __init__(self, network: Network):
        super().__init__(network)
        self.spread = StdHead(network.latent_transition)

    def distribution(
        self, latents: Tensor, memory: Memory | None = None
    ) -> tuple[Gaussian, Memory]:
        """Distribution of latent state transitions (B, T, 64), and the new memory."""
        transitions, memory = self(latents, memory)
        return self.spread(transitions), memory


class GaussianDecoder(Decoder):
    """D_e or D_n that estimates a distribution of state transitions.

    A second output layer gives the logarithm of each component's standard deviation.
    """

    def __init__(self, network: Network, *units_and_body: Any):
        super().__init__(network, *units_and_body)
        last: Any = self.dense[-1]
        self.spread = nn.Linear(network.decoder_hidden, last.out_features)
        scale_last(self.spread)

    def distribution(self, transitions: Tensor) -> Gaussian:
        """Distribution of the state transition (..., 13), raw units, of (..., 64)."""
        hidden = self.dense[:-1](transitions)
        std = self.spread(hidden).clamp(MIN_LOG_STD, MAX_LOG_STD).exp()
        mean = self.target_mean + self.target_std * self.dense[-1](hidden)
        return Gaussian(mean, self.target_std * std)


class DistributionModel(DynamicsModel):
    """Figure 1 with distributions in place of values.

    A call returns the mean of the transition, computed from the means of the latents.
    The means start as the values of a `DynamicsModel` with the same seed.
    """

    _parts = (GaussianEncoder, GaussianSIDM, GaussianDecoder)

    def draw_latents(
        self,
        role: str,
        inputs: Tensor,
        maps: Tensor,
        generator: torch.Generator | None = None,
    ) -> Tensor:
        """Sampled latent state-actions (B, T, latent)."""
        return self.encoders[role].distribution(inputs, maps).sample(generator)  # type: ignore[operator]

    def transit(
        self,
        latents: Tensor,
        memory: Memory | None = None,
        generator: torch.Generator | None = None,
    ) -> tuple[Tensor, Memory]:
        """Sampled latent transitions (B, T, latent_transition), and the memory."""
        transitions, memory = self.sidm.distribution(latents, memory)  # type: ignore[operator]
        return transitions.sample(generator), memory

    def predict(
        self,
        role: str,
        inputs: Tensor,
        maps: Tensor,
        memory: Memory | None = None,
        generator: torch.Generator | None = None,
    ) -> tuple[Gaussian, Memory]:
        """Distribution of the transition (B, T, 13), raw units, and the new memory.

        It is conditional on one sample of all latents.
        """
        latents = self.draw_latents(role, inputs, maps, generator)
        transitions, memory = self.transit(latents, memory, generator)
        return self.decoders[role].distribution(transitions), memory  # type: ignore[operator]

    def forward(
        self, role: str, inputs: Tensor, maps: Tensor, memory: Memory | None = None
    ) -> tuple[Tensor, Memory]:
        """Mean transitions (B, T, 13) and the memory, as `DynamicsModel` gives them."""
        prediction, memory = self.predict(role, inputs, maps, memory)
        return prediction.mean, memory


class ConstantSpread(NamedTuple):
    """A deterministic model with a constant standard deviation of its errors."""

    model: DynamicsModel  # predicts the mean of a normal distribution
    std: Tensor  # (13,), raw units

    def predict(
        self,
        role: str,
        inputs: Tensor,
        maps: Tensor,
        memory: Memory | None = None,
        generator: torch.Generator | None = None,
    ) -> tuple[Gaussian, Memory]:
        """As `DistributionModel.predict`; there are no latents to sample."""
        mean, memory = self.model(role, inputs, maps, memory)
        return Gaussian(mean, self.std.expand_as(mean)), memory


#: A model that predicts a distribution of transitions.
StochasticPredictor = DistributionModel | ConstantSpread


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
    sets = datasets._replace(validation=datasets.validation.first(0))
    return learn(LikelihoodTrainer(sets, network, training, seed, standardisation))


class LikelihoodModel(DistributionModel):
    """A model of distributions in training, with sampled latents; losses in nats."""

    def __init__(self, network: Network, units: Units, seed: int, roles: Iterable[str]):
        super().__init__(network, units, seed, roles)
        self.noise = seeds.generator(seed, "latents")

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


class LikelihoodTrainer(Trainer):
    """A model of distributions in training; the test loss is `mean_nll`."""

    model_class = LikelihoodModel  # type: ignore[assignment]
    model: LikelihoodModel

    def test_loss(self) -> float:
        """Mean negative log-likelihood of a step, nats, on the test split."""
        return mean_nll(self.model, self.test)
