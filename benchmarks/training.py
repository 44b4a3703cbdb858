"""How many samples a second training takes on two cores, beside a stand-in of the released loop, in one run.

Ours trains two trials at once, a process and a thread each; the stand-in is one process of two threads, as released.
"""

from __future__ import annotations

import functools
import multiprocessing
import time
from collections.abc import Callable
from multiprocessing.pool import Pool

import numpy as np
import torch
import torch.nn.functional as F
from rounds import rate, report
from torch import Tensor, nn
from torch.utils.flop_counter import FlopCounterMode

from sidm.learning import Datasets, Motion, Network, Training
from sidm.learning.learner import Learner
from sidm.learning.training import predict_phase

RELEASED = 676.0  # samples a second on two cores, as once measured: batch 2 x 64, 64 px, LSTM 3 x 256
STEPS, TRAJECTORIES = 64, 20
ROUNDS = 5


class ReleasedLoop:
    """The work of the released training loop, from its description: default layout, the terrain resampled every time.

    Each iteration draws a system and two of its trajectories, and cuts the map of each of their steps from a terrain of
    300 x 300 points at `resolution` pixels, reduced to 64. How finely the released one samples is not stated.
    """

    def __init__(self, resolution: int) -> None:
        """Networks and optimiser of the released sizes, random data."""
        torch.manual_seed(0)
        self.resolution = resolution
        self.terrains, self.poses = torch.randn(TRAJECTORIES, 300, 300), torch.rand(TRAJECTORIES, STEPS, 3) * 2 - 1
        self.inputs, self.targets = torch.randn(TRAJECTORIES, STEPS, 11), torch.randn(TRAJECTORIES, STEPS, 13)
        leaky = nn.LeakyReLU
        self.convolutions = nn.ModuleList(
            nn.Sequential(nn.Conv2d(1, 8, 4), leaky(), nn.Conv2d(8, 4, 4), leaky()) for _ in range(2)
        )
        self.dense = nn.ModuleList(
            nn.Sequential(nn.Linear(4 * 58**2 + 11, 128), leaky(), nn.Linear(128, 128), leaky()) for _ in range(2)
        )
        self.lstm, self.output = nn.LSTM(128, 256, 3, batch_first=True), nn.Sequential(nn.Linear(256, 64), leaky())
        self.decoders = nn.ModuleList(nn.Sequential(nn.Linear(64, 64), leaky(), nn.Linear(64, 13)) for _ in range(2))
        parts = self.convolutions, self.dense, self.lstm, self.output, self.decoders
        weights = [parameter for part in parts for parameter in part.parameters()]
        self.optimiser = torch.optim.Adam(weights, lr=1e-4, weight_decay=1e-5)

    def maps(self, chosen: Tensor) -> Tensor:
        """(2 T, 1, 64, 64): bilinear samples of the terrains around the robot's poses."""
        x, y, yaw = (self.poses[chosen] / torch.tensor([3.0, 3.0, 1.0])).flatten(0, 1).unbind(-1)
        cos, sin = yaw.cos() / 6, yaw.sin() / 6
        turn = torch.stack([torch.stack([cos, -sin, x], -1), torch.stack([sin, cos, y], -1)], -2)
        points = F.affine_grid(turn, [len(turn), 1, self.resolution, self.resolution], align_corners=True)
        terrains = self.terrains[chosen, None].expand(-1, STEPS, -1, -1).flatten(0, 1)[:, None]
        maps = F.grid_sample(terrains, points, padding_mode="border", align_corners=True)
        return maps if self.resolution == 64 else F.interpolate(maps, 64, mode="bilinear")

    def iterate(self, iterations: int = 8) -> int:
        """Prediction iterations, in samples."""
        for _ in range(iterations):
            system, chosen = int(torch.rand(()) < 0.75), torch.randint(TRAJECTORIES, (2,))
            features = self.convolutions[system](self.maps(chosen)).flatten(1)
            latents = self.dense[system](torch.cat([features, self.inputs[chosen].flatten(0, 1)], -1))
            hidden, _ = self.lstm(latents.unflatten(0, (2, STEPS)))
            loss = F.mse_loss(self.decoders[system](self.output(hidden)), self.targets[chosen])
            self.optimiser.zero_grad()
            loss.backward()
            self.optimiser.step()
        return iterations * 2 * STEPS


@functools.cache
def learner(pixels: int, batch: int, precision: str) -> Learner:
    """A training on random numbers, which take as long as real ones; of this process."""
    torch.set_num_threads(1)
    draw = torch.Generator().manual_seed(0)
    sizes = (TRAJECTORIES, STEPS, 11), (TRAJECTORIES, STEPS, 13), (TRAJECTORIES, STEPS, pixels, pixels)
    inputs, targets, maps = (torch.randn(size, generator=draw) for size in sizes)
    motion = Motion(inputs, targets, maps.half())
    training = Training(
        batch=batch, prediction_iterations=5, test_interval=10**6, max_samples=10**9, precision=precision
    )
    sets = Datasets(train=motion, test=motion, validation=motion, expert=motion)
    return Learner(sets, Network(pixels=pixels), training, seed=0)


def train(pixels: int, batch: int, precision: str) -> float:
    """Samples a second of wall-clock time of four short phases, in this process."""
    running = learner(pixels, batch, precision)
    before, start = running.samples, time.perf_counter()
    for _ in range(4):
        predict_phase(running)
    return (running.samples - before) / (time.perf_counter() - start)


def two_at_once(pool: Pool, *work: object) -> float:
    """The rates of two processes at the same work, added."""
    return sum(pool.starmap(train, [work] * 2, chunksize=1))


def operations(pixels: int, batch: int) -> float:
    """Floating point operations a sample of a prediction iteration, forward and backward."""
    running = learner(pixels, batch, "float32")
    before = running.samples
    with FlopCounterMode(display=False) as counter:
        predict_phase(running)
    network = running.network
    sizes = [network.latent] + [network.hidden] * network.layers
    lstm = sum(2 * 4 * network.hidden * (size + network.hidden) for size in sizes[:-1])
    return counter.get_total_flops() / (running.samples - before) + 3 * lstm  # the counter does not know the LSTM


def matrix_products(size: int = 1024) -> Callable[[], int]:
    """Work that multiplies square matrices, in operations."""
    left, right = torch.randn(2, size, size)

    def multiply() -> int:
        torch.mm(left, right)
        return 2 * size**3

    return multiply


def main() -> None:
    """Measure the released workload in turns with its stand-in, then the laptop preset's, and the floor."""
    stand_ins = {f"stand-in, resampling at {side} px": ReleasedLoop(side) for side in (64, 300)}
    ours = {f"ours, {precision}": (64, 2, precision) for precision in ("float32", "bfloat16")}
    laptop = {f"32 px, batch 8 x 64, {precision}": (32, 8, precision) for precision in ("float32", "bfloat16")}
    rates: dict[str, list[float]] = {}
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for work in (*ours.values(), *laptop.values()):
            two_at_once(pool, *work)  # warm up
        torch.set_num_threads(2)
        for _ in range(ROUNDS):
            for name, loop in stand_ins.items():
                start = time.perf_counter()
                rates.setdefault(name, []).append(loop.iterate() / (time.perf_counter() - start))
            for name, work in (ours | laptop).items():
                rates.setdefault(name, []).append(two_at_once(pool, *work))
    for name, found in rates.items():
        report(name, np.array(found), "samples a s", None if name in laptop else RELEASED)
    for name in ours:
        for stand_in in stand_ins:
            report(f"{name} / {stand_in}", np.array(rates[name]) / np.array(rates[stand_in]), "times")
    torch.set_num_threads(1)
    products, each = np.median(rate(matrix_products())), operations(64, 2)
    share = np.median(rates["ours, float32"]) / 2 * each / products
    print(f"floor: {each / 1e6:.1f} million operations a sample; at {products / 1e9:.0f} GFLOP/s of products a core")
    print(f"    at most {2 * products / each:.0f} samples a s on two cores; our share of it {share:.2f} in float32")


if __name__ == "__main__":
    main()
