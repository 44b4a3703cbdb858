"""A stand-in of the released training loop, written from its description: what ours is measured against."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn
from work import STEPS, TRAJECTORIES

from sidm.body import ROVER
from sidm.learning import RELEASED_NETWORK, Network

#: samples a second on two cores, as once measured: batch 2 x 64, 64 px, LSTM 3 x 256
RELEASED = 676.0


class ReleasedLoop:
    """The work of the released training loop, from its description: default layout, the terrain resampled every time.

    Each iteration draws a system and two of its trajectories, and cuts the map of each
    of their steps from a terrain of 300 x 300 points at `resolution` pixels, reduced to
    the networks'. How finely the released one samples is not stated.
    """

    def __init__(
        self, resolution: int, network: Network = RELEASED_NETWORK, device: str = "cpu"
    ) -> None:
        """Networks and optimiser of these sizes, random data."""
        torch.manual_seed(0)
        self.resolution, self.pixels = resolution, network.pixels
        with torch.device(device):
            self.terrains, self.poses = (
                torch.randn(TRAJECTORIES, 300, 300),
                torch.rand(TRAJECTORIES, STEPS, 3) * 2 - 1,
            )
            self.inputs, self.targets = (
                torch.randn(TRAJECTORIES, STEPS, 11),
                torch.randn(TRAJECTORIES, STEPS, 13),
            )
            self.scale = torch.tensor([3.0, 3.0, 1.0])
            parts = self._networks(network)
        self.optimiser = torch.optim.Adam(
            [w for part in parts for w in part.parameters()], lr=1e-4, weight_decay=1e-5
        )

    def _networks(self, network: Network) -> tuple[nn.Module, ...]:
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
        """(2 T, 1, P, P): bilinear samples of the terrains around the robot's poses."""
        x, y, yaw = (self.poses[chosen] / self.scale).flatten(0, 1).unbind(-1)
        cos, sin = yaw.cos() / 6, yaw.sin() / 6
        turn = torch.stack(
            [torch.stack([cos, -sin, x], -1), torch.stack([sin, cos, y], -1)], -2
        )
        points = F.affine_grid(
            turn, [len(turn), 1, self.resolution, self.resolution], align_corners=True
        )
        terrains = (
            self.terrains[chosen, None].expand(-1, STEPS, -1, -1).flatten(0, 1)[:, None]
        )
        maps = F.grid_sample(
            terrains, points, padding_mode="border", align_corners=True
        )
        return (
            maps
            if self.resolution == self.pixels
            else F.interpolate(maps, self.pixels, mode="bilinear")
        )

    def iterate(self, iterations: int = 8) -> int:
        """Prediction iterations, in samples."""
        for _ in range(iterations):
            system, chosen = (
                int(torch.rand(()) < 0.75),
                torch.randint(TRAJECTORIES, (2,)),
            )
            features = self.convolutions[system](self.maps(chosen)).flatten(1)
            latents = self.dense[system](
                torch.cat([features, self.inputs[chosen].flatten(0, 1)], -1)
            )
            hidden, _ = self.lstm(latents.unflatten(0, (2, STEPS)))
            loss = F.mse_loss(
                self.decoders[system](self.output(hidden)), self.targets[chosen]
            )
            self.optimiser.zero_grad()
            loss.backward()
            self.optimiser.step()
        return iterations * 2 * STEPS
