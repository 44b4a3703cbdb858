"""Encoders, SIDM and decoders that estimate distributions (section 3.2, last paragraph), all Gaussian and diagonal.

Latent state-actions and latent transitions are sampled by reparametrisation (Kingma and
Welling, 2014); the decoder gives mean and standard deviation of the transition. Without
a generator the latents are their means.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import torch
from torch import Tensor, nn

from sidm.body import ROVER, Body
from sidm.learning.model import DynamicsModel
from sidm.learning.networks import SIDM, Decoder, Encoder, Memory
from sidm.learning.units import Standardisation
from sidm.learning.weights import scale_last
from sidm.settings import Network

#: logarithm of a standard deviation, in the networks' units
QUIETEST, LOUDEST = -6.0, 2.0
QUIET = -3.0  # of the latents' at the start: about a twentieth of what they vary by


class Gaussian(NamedTuple):
    """Independent normal distributions."""

    mean: Tensor  # (...)
    std: Tensor  # (...)

    def sample(self, generator: torch.Generator | None) -> Tensor:
        """One draw of each (...), through which gradients reach both; the means without a generator."""
        if generator is None:
            return self.mean
        noise = torch.randn(self.mean.shape, generator=generator, dtype=self.mean.dtype)
        return self.mean + self.std * noise.to(self.mean.device)

    def nll(self, values: Tensor) -> Tensor:
        """Negative log-likelihood (...), nats, of values (..., K), summed over the last dimension."""
        return self.component_nll(values).sum(-1)

    def component_nll(self, values: Tensor) -> Tensor:
        """The same of each component alone, (..., K)."""
        return (
            ((values - self.mean) / self.std).square() / 2
            + self.std.log()
            + math.log(2 * math.pi) / 2
        )


class Spread(nn.Module):
    """From the means of latents to their distributions; at the start all are as quiet."""

    def __init__(self, size: int):
        super().__init__()
        self.dense = nn.Linear(size, size)
        nn.init.zeros_(self.dense.weight)
        nn.init.constant_(self.dense.bias, QUIET)

    def forward(self, mean: Tensor) -> Gaussian:
        """Independent normal distributions about latents (..., K)."""
        return Gaussian(mean, self.dense(mean).clamp(QUIETEST, LOUDEST).exp())


class GaussianEncoder(Encoder):
    """E_e or E_n: a distribution of latent state-actions about those of the deterministic twin."""

    def __init__(
        self,
        network: Network,
        standardisation: Standardisation | None = None,
        body: Body = ROVER,
    ):
        super().__init__(network, standardisation, body)
        self.spread = Spread(network.latent)

    def distribution(self, inputs: Tensor, maps: Tensor) -> Gaussian:
        """Of latent state-actions (B, T, 128), as `Encoder` gives their means."""
        return self.spread(self(inputs, maps))


class GaussianSIDM(SIDM):
    """The SIDM: a distribution of latent transitions about those of the deterministic twin."""

    def __init__(self, network: Network):
        super().__init__(network)
        self.spread = Spread(network.latent_transition)

    def distribution(
        self, latents: Tensor, memory: Memory | None = None
    ) -> tuple[Gaussian, Memory]:
        """Of latent state transitions (B, T, 64), and the memory, as `SIDM` gives them."""
        transitions, memory = self(latents, memory)
        return self.spread(transitions), memory


class GaussianDecoder(Decoder):
    """D_e or D_n with a second number for each component: the logarithm of its standard deviation."""

    def __init__(
        self,
        network: Network,
        standardisation: Standardisation | None = None,
        body: Body = ROVER,
    ):
        super().__init__(network, standardisation, body)
        self.spread = nn.Linear(network.decoder_hidden, len(body.targets))
        scale_last(self.spread)

    def distribution(self, transitions: Tensor) -> Gaussian:
        """Of the state transition y (..., 13), raw units, given latent state transitions (..., 64)."""
        hidden = self.dense[:-1](transitions)
        std = self.spread(hidden).clamp(QUIETEST, LOUDEST).exp()
        return Gaussian(
            self.target_mean + self.target_std * self.dense[-1](hidden),
            self.target_std * std,
        )


class Stochastic(Protocol):
    """What can say how sure it is of a transition."""

    def predict(
        self,
        role: str,
        inputs: Tensor,
        maps: Tensor,
        memory: Memory | None,
        generator: torch.Generator | None,
    ) -> tuple[Gaussian, Memory]:
        """The transition's distribution (B, T, 13), raw units, given one draw of all latents; and the memory."""


class DistributionModel(DynamicsModel):
    """Figure 1 with distributions in the place of values; called, it gives the mean that the latents' means lead to.

    Each latent has a standard deviation beside it; the means begin as those of the
    deterministic twin.
    """

    _parts = (GaussianEncoder, GaussianSIDM, GaussianDecoder)

    def draw_latents(
        self,
        role: str,
        inputs: Tensor,
        maps: Tensor,
        generator: torch.Generator | None = None,
    ) -> Tensor:
        """Latent state-actions (B, T, latent): a draw, or their means."""
        return self.encoders[role].distribution(inputs, maps).sample(generator)  # type: ignore[operator]

    def transit(
        self,
        latents: Tensor,
        memory: Memory | None = None,
        generator: torch.Generator | None = None,
    ) -> tuple[Tensor, Memory]:
        """Latent state transitions (B, T, latent_transition), a draw or their means, and the memory."""
        found, memory = self.sidm.distribution(latents, memory)  # type: ignore[operator]
        return found.sample(generator), memory

    def predict(
        self,
        role: str,
        inputs: Tensor,
        maps: Tensor,
        memory: Memory | None = None,
        generator: torch.Generator | None = None,
    ) -> tuple[Gaussian, Memory]:
        """As `Stochastic.predict`: of (B, T, 13)."""
        transitions, memory = self.transit(
            self.draw_latents(role, inputs, maps, generator), memory, generator
        )
        return self.decoders[role].distribution(transitions), memory  # type: ignore[operator]

    def forward(
        self, role: str, inputs: Tensor, maps: Tensor, memory: Memory | None = None
    ) -> tuple[Tensor, Memory]:
        """Means (B, T, 13) and the memory, as of `DynamicsModel`."""
        found, memory = self.predict(role, inputs, maps, memory)
        return found.mean, memory


class ConstantSpread:
    """The deterministic twin with errors that are as large everywhere: a normal distribution about what it predicts.

    Args:
        model: that predicts.
        std: (13,) of its errors, raw units.
    """

    def __init__(self, model: DynamicsModel, std: Tensor) -> None:
        self.model, self.std = model, std

    def predict(
        self,
        role: str,
        inputs: Tensor,
        maps: Tensor,
        memory: Memory | None = None,
        generator: torch.Generator | None = None,
    ) -> tuple[Gaussian, Memory]:
        """As `Stochastic.predict`: of (B, T, 13); there are no latents to draw."""
        mean, memory = self.model(role, inputs, maps, memory)
        return Gaussian(mean, self.std.expand_as(mean)), memory
