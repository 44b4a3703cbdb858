"""How sure a model is, and whether rightly so: likelihoods, coverage of one step, and particles over many steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from sidm import rotations
from sidm.learning.dataset import Motion
from sidm.learning.distributions import Gaussian, Stochastic
from sidm.learning.evaluation import EVALUATION_BATCH
from sidm.learning.networks import Memory
from sidm.learning.observation import encode_inputs, integrate, robot_centred_map
from sidm.trajectory import POSITION, QUATERNION

DRAWS = 16  # of the latents, whose mixture a likelihood is of
LEVELS = (0.5, 0.9)  # of the intervals


class Calibration(NamedTuple):
    """Of one step, over the steps of some motion."""

    nll: float  # negative log-likelihood, nats a sample
    coverage: tuple[float, ...]  # share of components within the central intervals of LEVELS


def one_step(model: Stochastic, motion: Motion, generator: torch.Generator, role: str = "novice") -> Calibration:
    """Likelihood and coverage of the mixture over DRAWS of the latents, whole trajectories each."""
    total, inside, count = 0.0, torch.zeros(len(LEVELS), dtype=torch.float64), 0
    with torch.inference_mode():
        for part in motion.split(EVALUATION_BATCH):
            drawn = [model.predict(role, part.inputs, part.maps, None, generator)[0] for _ in range(DRAWS)]
            logs = torch.stack([-one.nll(part.targets) for one in drawn]).double()  # (D, B, T)
            total -= float((torch.logsumexp(logs, 0) - math.log(DRAWS)).sum())
            rank = torch.stack([_below(one, part.targets) for one in drawn]).mean(0)  # (B, T, 13)
            for number, level in enumerate(LEVELS):
                inside[number] += (2 * (rank - 0.5).abs() <= level).double().mean(-1).sum().cpu()
            count += part.targets[..., 0].numel()
    return Calibration(total / count, tuple((inside / count).tolist()))


def _below(found: Gaussian, values: Tensor) -> Tensor:
    """The probability of less than `values`."""
    return torch.special.ndtr((values - found.mean) / found.std)


def particle_rollout(
    model: Stochastic,
    heights: Tensor,
    state: Tensor,
    actions: Tensor,
    pixels: int,
    count: int,
    generator: torch.Generator,
    role: str = "novice",
    spacing: float = 0.1,
) -> Tensor:
    """Many ways a drive may go on: at each step every particle draws its latents and its transition.

    Args:
        model: that predicts distributions.
        heights: (H, W), m.
        state: (13,) where all particles start.
        actions: (K, 2).
        pixels: P of the model's maps.
        count: S, of particles.
        generator: of all draws.
        role: whose encoder and decoder.
        spacing: of the ground's grid, m.

    Returns:
        States (S, K + 1, 13), the given one first.
    """
    states: list[Tensor] = [state.double().expand(count, -1)]
    memory: Memory | None = None
    with torch.inference_mode():
        for action in actions.double():
            inputs = encode_inputs(states[-1], action.expand(count, -1)).float()[:, None]
            maps = robot_centred_map(heights, states[-1], pixels, spacing=spacing).half()[:, None]
            found, memory = model.predict(role, inputs, maps, memory, generator)
            states.append(integrate(states[-1], found.sample(generator)[:, 0].double()))
    return torch.stack(states, dim=1)


def covered(particles: Tensor, actual: Tensor, levels: Sequence[float] = LEVELS) -> Tensor:
    """Whether what happened lies within the particles' central intervals.

    Args:
        particles: states (S, K + 1, 13).
        actual: states (K + 1, 13).
        levels: of the intervals.

    Returns:
        (L, K, 3) bool, without the start: along and across the heading of the start, and of the heading itself.
    """
    numbers, truth = _seen_from_start(particles), _seen_from_start(actual[None])[0]  # (S, K, 3), (K, 3)
    ends = [(0.5 - level / 2, 0.5 + level / 2) for level in levels]
    return torch.stack([
        (numbers.quantile(low, dim=0) <= truth) & (truth <= numbers.quantile(high, dim=0)) for low, high in ends
    ])  # fmt: skip


def _seen_from_start(states: Tensor) -> Tensor:
    """(S, K, 3): metres forward and to the left of the start, and the turn since, rad, of states (S, K + 1, 13)."""
    start = rotations.yaw(states[:1, :1, QUATERNION])  # (1, 1)
    moved = states[:, 1:, POSITION] - states[:, :1, POSITION]
    turn = rotations.wrap(rotations.yaw(states[:, 1:, QUATERNION]) - start)
    cos, sin = start.cos(), start.sin()
    forward, left = cos * moved[..., 0] + sin * moved[..., 1], cos * moved[..., 1] - sin * moved[..., 0]
    return torch.stack([forward, left, turn], dim=-1)
