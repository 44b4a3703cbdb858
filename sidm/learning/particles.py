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
from sidm.learning.observation import TARGET_SIZE, encode_inputs, integrate, robot_centred_map
from sidm.trajectory import QUATERNION

DRAWS = 16  # of the latents, whose mixture a likelihood is of
LEVELS = (0.5, 0.9)  # of the intervals


class Calibration(NamedTuple):
    """Of one step, over the steps of some motion."""

    nll: float  # negative log-likelihood, nats a sample
    coverage: tuple[tuple[float, ...], ...]  # (L, 13) share of steps within the central intervals of LEVELS


def one_step(model: Stochastic, motion: Motion, generator: torch.Generator, role: str = "novice") -> Calibration:
    """Likelihood and coverage of the mixture over DRAWS of the latents, whole trajectories each.

    Of so few draws the likelihood is a little too small, on average.
    """
    total, inside, count = 0.0, torch.zeros(len(LEVELS), TARGET_SIZE, dtype=torch.float64), 0
    with torch.inference_mode():
        for part in motion.split(EVALUATION_BATCH):
            drawn = [model.predict(role, part.inputs, part.maps, None, generator)[0] for _ in range(DRAWS)]
            logs = torch.stack([-one.nll(part.targets) for one in drawn]).double()  # (D, B, T)
            total -= float((torch.logsumexp(logs, 0) - math.log(DRAWS)).sum())
            rank = torch.stack([_below(one, part.targets) for one in drawn]).mean(0)  # (B, T, 13)
            for number, level in enumerate(LEVELS):
                inside[number] += (2 * (rank - 0.5).abs() <= level).double().sum((0, 1)).cpu()
            count += part.targets[..., 0].numel()
    return Calibration(total / count, tuple(tuple(level.tolist()) for level in inside / count))


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
    heading = rotations.yaw(particles[..., QUATERNION])[:, 1:]  # (S, K)
    middle = torch.atan2(heading.sin().mean(0), heading.cos().mean(0))  # (K,): turns are counted from there
    start = rotations.yaw(actual[0, QUATERNION])
    numbers, truth = (_seen(states, start, middle) for states in (particles[:, 1:], actual[1:]))  # (S, K, 3), (K, 3)
    ends = (central(numbers, level) for level in levels)
    return torch.stack([(low <= truth) & (truth <= high) for low, high in ends])


def central(values: Tensor, level: float, dim: int = 0) -> tuple[Tensor, Tensor]:
    """The ends between which a new draw lies with probability `level`, of S draws of one distribution along `dim`."""
    count = values.shape[dim]
    low, high = (
        min(max((share * (count + 1) - 1) / (count - 1), 0.0), 1.0) for share in (0.5 - level / 2, 0.5 + level / 2)
    )
    return values.quantile(low, dim=dim), values.quantile(high, dim=dim)


def _seen(states: Tensor, heading: Tensor, middle: Tensor) -> Tensor:
    """(..., K, 3): metres along and across a `heading`, the turn from a `middle` (K,), rad, of states (..., K, 13)."""
    x, y = states[..., 0], states[..., 1]
    turn = rotations.wrap(rotations.yaw(states[..., QUATERNION]) - middle)
    cos, sin = heading.cos(), heading.sin()
    return torch.stack([cos * x + sin * y, cos * y - sin * x, turn], dim=-1)
