"""Encoder, system invariant dynamics model (SIDM), decoder and discriminator.

They are described in section 4 of the paper. In shapes, B is the number of
trajectories, T of steps, P of map pixels along a side.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar

import torch
from torch import Tensor, nn

from sidm.body import ROVER, Body
from sidm.learning import convolution
from sidm.learning.observation import require_shape
from sidm.learning.seeds import derive
from sidm.learning.units import Standardisation, divisor, loss_weights
from sidm.learning.weights import (
    scale_columns,
    scale_last,
    scale_layers,
    scale_recurrence,
)
from sidm.settings import Network

M = TypeVar("M", bound=nn.Module)
#: the LSTM's hidden and cell state, each (layers, B, hidden)
Memory = tuple[Tensor, Tensor]


class Encoder(nn.Module):
    """E_e or E_n: from state-actions to latent state-actions."""

    input_mean: Tensor
    input_std: Tensor
    map_mean: Tensor
    map_std: Tensor

    def __init__(
        self,
        network: Network,
        standardisation: Standardisation | None = None,
        body: Body = ROVER,
    ):
        super().__init__()
        first, second = network.channels
        self.size, self.pixels = len(body.inputs), body.pixels(network.pixels)
        layers: list[nn.Module] = []
        if self.pixels:
            layers = [
                nn.Conv2d(1, first, network.kernel),
                nn.LeakyReLU(network.slope, inplace=True),
                nn.Conv2d(first, second, network.kernel),
                nn.LeakyReLU(network.slope, inplace=True),
            ]
        self.convolutions = nn.Sequential(*layers).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        features = second * network.map_side(body) ** 2
        self.dense = nn.Sequential(
            nn.Linear(features + self.size, network.encoder_hidden),
            nn.LeakyReLU(network.slope),
            nn.Linear(network.encoder_hidden, network.latent),
            nn.LeakyReLU(network.slope),
        )
        if network.initialisation == "scaled":
            scale_layers(self, network.slope)
            scale_columns(self.dense[0], slice(-self.size, None), network.slope)
        units = standardisation or Standardisation.none(body)
        for name in ("input_mean", "input_std", "map_mean", "map_std"):
            self.register_buffer(name, getattr(units, name).clone())

    def forward(self, inputs: Tensor, maps: Tensor) -> Tensor:
        """Latents (B, T, latent) of inputs (B, T, X), raw units, and maps, m.

        Maps are (B, T, P, P).
        """
        require_shape(inputs, ("B", "T", self.size), "inputs")
        require_shape(maps, (*inputs.shape[:2], self.pixels, self.pixels), "maps")
        numbers = (inputs - self.input_mean) / self.input_std
        features = numbers.flatten(0, 1)  # (B T, X)
        if self.pixels:
            maps = maps.flatten(0, 1).to(inputs.dtype)  # (B T, P, P)
            features = self._features(maps, features)
        return self.dense(features).unflatten(0, inputs.shape[:2])

    def _features(self, maps: Tensor, numbers: Tensor) -> Tensor:
        """Features of maps (N, P, P), m, then numbers (N, X): (N, 4 (P - 6)^2 + X)."""
        layers = self.convolutions
        if convolution.is_fast_for(layers, maps, numbers):
            return convolution.features(
                layers, maps, numbers, self.map_mean, self.map_std
            )
        pixels = (maps - self.map_mean) / self.map_std
        # The channel becomes the last dimension in memory, which is twice as fast on a
        # CPU as the default layout.
        channels = layers(pixels.unsqueeze(-1).movedim(-1, 1))  # (N, 4, P - 6, P - 6)
        features = channels.movedim(1, -1).flatten(1)
        return torch.cat([features, numbers], dim=-1)


class SIDM(nn.Module):
    """System invariant dynamics model: an LSTM on latents, step by step."""

    def __init__(self, network: Network):
        super().__init__()
        self.latent, hidden = network.latent, network.hidden
        self.lstm = nn.LSTM(network.latent, hidden, network.layers, batch_first=True)
        dense = nn.Linear(hidden, network.latent_transition)
        self.output = nn.Sequential(dense, nn.LeakyReLU(network.slope))
        if network.initialisation == "scaled":
            scale_recurrence(self.lstm)
            scale_layers(self.output, network.slope)

    def forward(
        self, latents: Tensor, memory: Memory | None = None
    ) -> tuple[Tensor, Memory]:
        """Latent transitions (B, T, 64) of latents (B, T, 128), and the last memory.

        `memory` is that of the step before; None where the trajectories begin.
        """
        require_shape(latents, ("B", "T", self.latent), "latents")
        hidden, memory = self.lstm(latents, memory)
        return self.output(hidden), memory


class Decoder(nn.Module):
    """D_e or D_n: from latent state transitions to state transitions in raw units."""

    weights: Tensor | None  # (Y,), of the components in equation (1); None: all are 1

    def __init__(
        self,
        network: Network,
        standardisation: Standardisation | None = None,
        body: Body = ROVER,
    ):
        super().__init__()
        self.size = network.latent_transition
        self.dense = nn.Sequential(
            nn.Linear(network.latent_transition, network.decoder_hidden),
            nn.LeakyReLU(network.slope),
            nn.Linear(network.decoder_hidden, len(body.targets)),
        )
        if network.initialisation == "scaled":
            scale_layers(self, network.slope)
            scale_last(self.dense[-1])
        units = standardisation or Standardisation.none(body)
        self.register_buffer("target_mean", units.target_mean.clone())
        weights, std = loss_weights(body, units), units.target_std
        # a constant without weight in the loss is not learnt: its mean is predicted
        std = divisor(std) if weights is None else std
        self.register_buffer("target_std", std.clone())
        # not persistent: a decoder that starts from stored weights keeps its own
        self.register_buffer("weights", weights, persistent=False)

    def forward(self, transitions: Tensor) -> Tensor:
        """State transitions y' (..., Y) of latent state transitions (..., 64)."""
        require_shape(transitions, ("...", self.size), "latent transitions")
        return self.target_mean + self.target_std * self.dense(transitions)


class Discriminator(nn.Module):
    """A: the probability that a latent state-action came from the expert."""

    def __init__(self, network: Network):
        super().__init__()
        self.latent = network.latent
        self.dense = nn.Sequential(
            nn.Linear(network.latent, network.discriminator_hidden),
            nn.LeakyReLU(network.slope),
            nn.Linear(network.discriminator_hidden, 1),
        )

    def logits(self, latents: Tensor) -> Tensor:
        """Logits s (...) of latents (..., 128); A is sigmoid(s)."""
        require_shape(latents, ("...", self.latent), "latents")
        return self.dense(latents).squeeze(-1)

    def forward(self, latents: Tensor) -> Tensor:
        """Probabilities (...) in (0, 1) of latents (..., 128)."""
        return torch.sigmoid(self.logits(latents))


def seeded(seed: int, part: str, build: Callable[[], M]) -> M:
    """Build a module with weights that depend on `seed` and `part` alone."""
    with torch.random.fork_rng(devices=[]):
        torch.default_generator.manual_seed(derive(seed, part))
        return build()


def parameter_count(module: nn.Module) -> int:
    """Number of a module's parameters."""
    return sum(math.prod(parameter.shape) for parameter in module.parameters())
