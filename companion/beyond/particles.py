"""How sure a model is, and whether rightly so: likelihoods, coverage of one step, and particles over many steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from companion.beyond.distributions import Stochastic
from sidm import rotations
from sidm.drives import QUATERNION
from sidm.learning.dataset import Windows
from sidm.learning.evaluation import EVALUATION_BATCH
from sidm.learning.networks import Memory
from sidm.learning.observation import (
    TARGET_SIZE,
    encode_inputs,
    integrate,
    robot_centred_map,
)

DRAWS = 16  # of the latents, whose mixture a likelihood is of
LEVELS = (0.5, 0.9)  # of the intervals
QUANTILES = (0.5, 0.9, 0.99, 1.0)  # of the likelihoods of single steps


class Calibration(NamedTuple):
    """Of one step, over the steps of some motion."""

    nll: float  # negative log-likelihood, nats a sample
    #: QUANTILES of that of single steps: few may make most of the mean
    nll_quantiles: tuple[float, ...]
    component_nll: tuple[float, ...]  # (13,) of each component alone
    #: (13,) mean standard deviation given the latents, raw units
    spread: tuple[float, ...]
    #: (L, 13) share of steps within the central intervals of LEVELS
    coverage: tuple[tuple[float, ...], ...]


def one_step(
    model: Stochastic,
    motion: Windows,
    generator: torch.Generator | None,
    draws: int = DRAWS,
) -> Calibration:
    """Likelihood and coverage of the mixture over so many draws of the latents, whole trajectories each.

    Of few draws the likelihood is too small, on average. Without a generator the
    latents are their means.
    """
    steps: list[Tensor] = []  # negative log-likelihoods
    alone, spread = (torch.zeros(TARGET_SIZE, dtype=torch.float64) for _ in range(2))
    inside = torch.zeros(len(LEVELS), TARGET_SIZE, dtype=torch.float64)
    with torch.inference_mode():
        for part in motion.split(EVALUATION_BATCH):
            drawn = [
                model.predict("novice", part.inputs, part.maps, None, generator)[0]
                for _ in range(draws)
            ]
            # (D, B, T, 13)
            logs = torch.stack(
                [-one.component_nll(part.targets) for one in drawn]
            ).double()
            steps.append(math.log(draws) - torch.logsumexp(logs.sum(-1), 0).flatten())
            alone -= (torch.logsumexp(logs, 0) - math.log(draws)).sum((0, 1))
            spread += (
                torch.stack([one.std for one in drawn]).double().mean(0).sum((0, 1))
            )
            ranks = [
                torch.special.ndtr((part.targets - one.mean) / one.std) for one in drawn
            ]
            rank = torch.stack(ranks).mean(0)  # (B, T, 13), the probability of less
            for number, level in enumerate(LEVELS):
                inside[number] += (2 * (rank - 0.5).abs() <= level).double().sum((0, 1))
    nll = torch.cat(steps)
    components, spreads = (
        tuple((some / len(nll)).tolist()) for some in (alone, spread)
    )
    quantiles = tuple(torch.quantile(nll, nll.new_tensor(QUANTILES)).tolist())
    shares = tuple(tuple(level.tolist()) for level in inside / len(nll))
    return Calibration(float(nll.mean()), quantiles, components, spreads, shares)


def particle_rollout(
    model: Stochastic,
    heights: Tensor,
    state: Tensor,
    actions: Tensor,
    pixels: int,
    count: int,
    generator: torch.Generator,
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

    Returns:
        States (S, K + 1, 13), the given one first.
    """
    states: list[Tensor] = [state.double().expand(count, -1)]
    memory: Memory | None = None
    with torch.inference_mode():
        for action in actions.double():
            inputs = encode_inputs(states[-1], action.expand(count, -1)).float()[
                :, None
            ]
            maps = robot_centred_map(heights, states[-1], pixels).half()[:, None]
            found, memory = model.predict("novice", inputs, maps, memory, generator)
            states.append(integrate(states[-1], found.sample(generator)[:, 0].double()))
    return torch.stack(states, dim=1)


class Along(NamedTuple):
    """Particles beside what happened, without the start: along and across its heading, m, and of the heading, rad."""

    inside: Tensor  # (L, K, 3) bool, whether the central intervals hold it
    width: Tensor  # (L, K, 3) of the intervals
    error: Tensor  # (K, 3) how far the particles' mean is off


def covered(
    particles: Tensor, actual: Tensor, levels: Sequence[float] = LEVELS
) -> Along:
    """How the particles' central intervals fit what happened.

    Args:
        particles: states (S, K + 1, 13).
        actual: states (K + 1, 13).
        levels: of the intervals.
    """
    heading = rotations.yaw(particles[..., QUATERNION])[:, 1:]  # (S, K)
    # (K,): turns are counted from there
    middle = torch.atan2(heading.sin().mean(0), heading.cos().mean(0))
    start = rotations.yaw(actual[0, QUATERNION])
    # (S, K, 3), (K, 3)
    numbers, truth = (
        _seen(states, start, middle) for states in (particles[:, 1:], actual[1:])
    )
    ends = [central(numbers, level) for level in levels]
    inside = torch.stack([(low <= truth) & (truth <= high) for low, high in ends])
    width = torch.stack([high - low for low, high in ends])
    return Along(inside, width, (numbers.mean(0) - truth).abs())


def central(values: Tensor, level: float) -> tuple[Tensor, Tensor]:
    """The ends (...) between which a new draw lies with probability `level`, of S draws (S, ...)."""
    count = len(values)
    low, high = (
        min(max((share * (count + 1) - 1) / (count - 1), 0.0), 1.0)
        for share in (0.5 - level / 2, 0.5 + level / 2)
    )
    return values.quantile(low, dim=0), values.quantile(high, dim=0)


def _seen(states: Tensor, heading: Tensor, middle: Tensor) -> Tensor:
    """(..., K, 3): metres along and across a `heading`, the turn from a `middle` (K,), rad, of states (..., K, 13)."""
    turn = rotations.wrap(rotations.yaw(states[..., QUATERNION]) - middle)
    return torch.cat(
        [rotations.turn(states[..., :2], -heading), turn[..., None]], dim=-1
    )
