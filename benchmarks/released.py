"""A stand-in of the released training loop, written from its description.

The benchmarks compare this repository's training with it.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn
from work import STEPS, TRAJECTORIES

from sidm.body import ROVER
from sidm.learning import RELEASED_NETWORK, Network

#: Samples a second of the released loop on two cores, as once measured: batch of
#: 2 trajectories x 64 steps, 64 px, LSTM 3 x 256.
RELEASED = 676.0


class ReleasedLoop:
    """The work of the released training loop: default layout, terrain always resampled.

    Each iteration draws a system and two of its trajectories. It samples the map of
    each step from a terrain of 300 x 300 points at `resolution` pixels and reduces the
    map to the pixels of the networks. How finely the released loop samples is not
    stated.
    """

    def __init__(
        self, resolution: int, network: Network = RELEASED_NETWORK, device: str = "cpu"
    ) -> None:
        """Make the networks, their optimiser and random data."""
        torch.manual_seed(0)
        self.resolution, self.pixels = resolution, network.pixels
        with torch.device(device):
            self.terrains = torch.randn(TRAJECTORIES, 300, 300)
            self.poses = torch.rand(TRAJECTORIES, STEPS, 3) * 2 - 1
            self.inputs = torch.randn(TRAJECTORIES, STEPS, 11)
            self.targets = torch.randn(TRAJECTORIES, STEPS, 13)
            self.scale = torch.tensor([3.0, 3.0, 1.0])
            parts = nn.ModuleList(self._networks(network))
        self.optimiser = torch.optim.Adam(
            parts.parameters(), lr=1e-4, weight_decay=1e-5
        )

    def _networks(self, network: Network) -> tuple[nn.Module, ...]:
        """Encoders and decoders of two systems and the LSTM that they share."""
        leaky, count = nn.LeakyReLU, 4 * network.map_side(ROVER) ** 2 + 11
        self.convolutions = nn.ModuleList(
            nn.Sequential(nn.Conv2d(1, 8, 4), leaky(), nn.Conv2d(8, 4, 4), leaky())
            for _ in range(2)
        )
        self.dense = nn.ModuleList(
            nn.Sequential(nn.Linear(count, 128), leaky(), nn.Linear(128, 128), leaky())
            for _ in range(2)
        )
        self.lstm = nn.LSTM(128, network.hidden, network.layers, batch_first=True)
        self.output = nn.Sequential(nn.Linear(network.hidden, 64), leaky())
        self.decoders = nn.ModuleList(
            nn.Sequential(nn.Linear(64, 64), leaky(), nn.Linear(64, 13))
            for _ in range(2)
        )
        return self.convolutions, self.dense, self.lstm, self.output, self.decoders

    def maps(self, chosen: Tensor) -> Tensor:
        """Maps (2 T, 1, P, P): bilinear samples of the terrains around the poses."""
        x, y, yaw = (self.poses[chosen] / self.scale).flatten(0, 1).unbind(-1)
        cos, sin = yaw.cos() / 6, yaw.sin() / 6
        turn = torch.stack(
            [torch.stack([cos, -sin, x], -1), torch.stack([sin, cos, y], -1)], -2
        )
        side = self.resolution
        points = F.affine_grid(turn, [len(turn), 1, side, side], align_corners=True)
        terrains = self.terrains[chosen, None].expand(-1, STEPS, -1, -1)
        maps = F.grid_sample(
            terrains.flatten(0, 1)[:, None],  # (2 T, 1, 300, 300)
            points,
            padding_mode="border",
            align_corners=True,
        )
        if side == self.pixels:
            return maps
        return F.interpolate(maps, self.pixels, mode="bilinear")

    def iterate(self, iterations: int = 8) -> int:
        """Run prediction iterations and return their number of samples."""
        for _ in range(iterations):
            system = int(torch.rand(()) < 0.75)
            chosen = torch.randint(TRAJECTORIES, (2,))
            features = self.convolutions[system](self.maps(chosen)).flatten(1)
            inputs = self.inputs[chosen].flatten(0, 1)
            latents = self.dense[system](torch.cat([features, inputs], -1))
            hidden, _ = self.lstm(latents.unflatten(0, (2, STEPS)))
            predictions = self.decoders[system](self.output(hidden))
            loss = F.mse_loss(predictions, self.targets[chosen])
            self.optimiser.zero_grad()
            loss.backward()
            self.optimiser.step()
        return iterations * 2 * STEPS
