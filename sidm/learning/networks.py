"""Encoders, system invariant dynamics model (SIDM), decoders and discriminator (section 4 of the paper).

B trajectories, T steps, P map pixels a side.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar

import torch
from torch import Tensor, nn

from sidm.body import ROVER, Body
from sidm.learning import convolution
from sidm.learning.seeds import derive
from sidm.learning.units import Standardisation, loss_weights
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
    """E_e or E_n: state-actions to latent state-actions."""

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
        layers = (
            [
                nn.Conv2d(1, first, network.kernel),
                nn.LeakyReLU(network.slope, inplace=True),
                nn.Conv2d(first, second, network.kernel),
                nn.LeakyReLU(network.slope, inplace=True),
            ]
            if self.pixels
            else []
        )
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
        """Latent state-actions (B, T, latent) of inputs (B, T, X), raw units, and maps (B, T, P, P), m.

        Under `torch.autocast` the layers compute in its precision; the latents have the
        inputs' all the same.
        """
        expect(inputs, ("B", "T", self.size), "inputs")
        expect(maps, (*inputs.shape[:2], self.pixels, self.pixels), "maps")
        # (B T, X)
        numbers = ((inputs - self.input_mean) / self.input_std).flatten(0, 1)
        if self.pixels:
            numbers = self._beside_features(
                maps.flatten(0, 1).to(inputs.dtype), numbers
            )
        return self.dense(numbers).to(inputs.dtype).unflatten(0, inputs.shape[:2])

    def _beside_features(self, maps: Tensor, numbers: Tensor) -> Tensor:
        """Features of maps (N, P, P), m, with numbers (N, X) behind them: (N, 4 (P - 6)^2 + X)."""
        if convolution.is_fast_for(self.convolutions, maps, numbers):
            return convolution.features(
                self.convolutions, maps, numbers, self.map_mean, self.map_std
            )
        pixels = (maps - self.map_mean) / self.map_std
        # The channel is made the last dimension in memory: twice as fast on a CPU as
        # the default layout.
        features = (
            self.convolutions(pixels.unsqueeze(-1).movedim(-1, 1))
            .movedim(1, -1)
            .flatten(1)
        )
        return torch.cat([features, numbers.to(features.dtype)], dim=-1)


class SIDM(nn.Module):
    """The system invariant dynamics model: latent state-actions to latent state transitions, along a trajectory."""

    def __init__(self, network: Network):
        super().__init__()
        self.latent = network.latent
        self.lstm = nn.LSTM(
            network.latent, network.hidden, network.layers, batch_first=True
        )
        self.output = nn.Sequential(
            nn.Linear(network.hidden, network.latent_transition),
            nn.LeakyReLU(network.slope),
        )
        if network.initialisation == "scaled":
            scale_recurrence(self.lstm)
            scale_layers(self.output, network.slope)

    def forward(
        self, latents: Tensor, memory: Memory | None = None
    ) -> tuple[Tensor, Memory]:
        """Latent state transitions (B, T, 64) of latents (B, T, 128), and the memory after the last step.

        Without `memory` the trajectories begin here.
        """
        expect(latents, ("B", "T", self.latent), "latents")
        hidden, memory = self.lstm(latents, memory)
        return self.output(hidden), memory


class Decoder(nn.Module):
    """D_e or D_n: latent state transitions to state transitions in raw units."""

    weights: Tensor | None  # (Y,), of the components in equation (1); None: all 1

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
        self.register_buffer("target_std", units.target_std.clone())
        # its own, whatever it starts from
        self.register_buffer("weights", loss_weights(body, units), persistent=False)

    def forward(self, transitions: Tensor) -> Tensor:
        """State transitions y' (..., Y) of latent state transitions (..., 64)."""
        expect(transitions, (*transitions.shape[:-1], self.size), "latent transitions")
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
        """Log odds (...) of latents (..., 128)."""
        expect(latents, (*latents.shape[:-1], self.latent), "latents")
        return self.dense(latents).squeeze(-1)

    def forward(self, latents: Tensor) -> Tensor:
        """Probabilities (...) in (0, 1) of latents (..., 128)."""
        return torch.sigmoid(self.logits(latents))


def seeded(seed: int, part: str, build: Callable[[], M]) -> M:
    """What `build` makes, its initial weights given by `seed` and `part` alone; global randomness is left as it was."""
    with torch.random.fork_rng(devices=[]):
        torch.default_generator.manual_seed(derive(seed, part))
        return build()


def parameter_count(module: nn.Module) -> int:
    """How many numbers the module learns."""
    return sum(math.prod(parameter.shape) for parameter in module.parameters())


def expect(tensor: Tensor, shape: tuple[int | str, ...], name: str) -> None:
    """ValueError giving both shapes unless `tensor` has `shape`, in which names stand for any length."""
    if tensor.ndim == len(shape):
        if all(
            isinstance(want, str) or have == want
            for have, want in zip(tensor.shape, shape, strict=True)
        ):
            return
    wanted = ", ".join(map(str, shape))
    raise ValueError(f"{name} must have shape ({wanted}), not {tuple(tensor.shape)}")
