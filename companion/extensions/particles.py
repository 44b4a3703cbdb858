"""Calibration of predicted distributions.

For one step: the likelihood and the coverage of intervals. For many steps: the coverage
of the intervals of particles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from companion.extensions.distributions import StochasticPredictor
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

DRAWS = 16  # samples of the latents, which make the mixture of a likelihood
LEVELS = (0.5, 0.9)  # probabilities of the central intervals
QUANTILES = (0.5, 0.9, 0.99, 1.0)  # reported of the likelihoods of single steps


class Calibration(NamedTuple):
    """Calibration of one step, over all steps of a motion."""

    nll: float  # mean negative log-likelihood of a step, nats
    #: QUANTILES of a step's negative log-likelihood: few steps may dominate the mean
    nll_quantiles: list[float]
    component_nll: list[float]  # (13,) mean of each component alone, nats
    spread: list[float]  # (13,) mean standard deviation given the latents, raw units
    #: (L, 13) share of steps within the central intervals of LEVELS
    coverage: list[list[float]]


def one_step(
    model: StochasticPredictor,
    motion: Windows,
    generator: torch.Generator | None,
    draws: int = DRAWS,
) -> Calibration:
    """Likelihood and coverage of the mixture over `draws` samples of the latents.

    Few samples give too small a likelihood, on average. Each is a sample for whole
    trajectories; without a generator the latents are at their means.
    """
    step_nll: list[Tensor] = []  # of single steps
    component_nll = torch.zeros(TARGET_SIZE, dtype=torch.float64)  # sum over the steps
    spread = torch.zeros(TARGET_SIZE, dtype=torch.float64)  # sum over the steps
    inside = torch.zeros(len(LEVELS), TARGET_SIZE, dtype=torch.float64)
    with torch.inference_mode():
        for part in motion.split(EVALUATION_BATCH):
            drawn = [
                model.predict("novice", part.inputs, part.maps, None, generator)[0]
                for _ in range(draws)
            ]
            likelihoods = [-sample.nll(part.targets) for sample in drawn]
            logs = torch.stack(likelihoods).double()  # (D, B, T, 13)
            mixture = torch.logsumexp(logs.sum(-1), 0)  # (B, T)
            step_nll.append(math.log(draws) - mixture.flatten())
            component_nll -= (torch.logsumexp(logs, 0) - math.log(draws)).sum((0, 1))
            stds = torch.stack([sample.std for sample in drawn]).double()
            spread += stds.mean(0).sum((0, 1))
            scores = [(part.targets - sample.mean) / sample.std for sample in drawn]
            # (B, T, 13), the predicted probability of a smaller value
            rank = torch.special.ndtr(torch.stack(scores)).mean(0)
            for number, level in enumerate(LEVELS):
                inside[number] += (2 * (rank - 0.5).abs() <= level).double().sum((0, 1))
    nll = torch.cat(step_nll)
    quantiles = torch.quantile(nll, nll.new_tensor(QUANTILES))
    sums = (total / len(nll) for total in (component_nll, spread, inside))
    lists = (values.tolist() for values in (quantiles, *sums))
    return Calibration(float(nll.mean()), *lists)


def particle_rollout(
    model: StochasticPredictor,
    heights: Tensor,
    state: Tensor,
    actions: Tensor,
    pixels: int,
    count: int,
    generator: torch.Generator,
) -> Tensor:
    """Sampled rollouts: at each step, each particle samples latents and transition.

    From a state (13,) and actions (K, 2) on heights (H, W), m, `count` particles have
    states (count, K + 1, 13), the given one first.
    """
    states: list[Tensor] = [state.double().expand(count, -1)]
    memory: Memory | None = None
    with torch.inference_mode():
        for action in actions.double():
            inputs = encode_inputs(states[-1], action.expand(count, -1)).float()
            maps = robot_centred_map(heights, states[-1], pixels).half()
            prediction, memory = model.predict(
                "novice", inputs[:, None], maps[:, None], memory, generator
            )
            transition = prediction.sample(generator)[:, 0]
            states.append(integrate(states[-1], transition.double()))
    return torch.stack(states, dim=1)


class PathCoverage(NamedTuple):
    """Intervals of particles beside the actual path, without the first state.

    The three values are the positions along and across the actual heading at the start,
    m, and the heading, rad.
    """

    inside: Tensor  # (L, K, 3) bool, whether the intervals hold the actual value
    width: Tensor  # (L, K, 3) of the central intervals
    error: Tensor  # (K, 3) absolute error of the particles' mean


def path_coverage(
    particles: Tensor, actual: Tensor, levels: Sequence[float] = LEVELS
) -> PathCoverage:
    """Compare particles (S, K + 1, 13) with an actual path (K + 1, 13)."""
    heading = rotations.yaw(particles[..., QUATERNION])[:, 1:]  # (S, K)
    # (K,), the mean heading, from which headings are measured
    middle = torch.atan2(heading.sin().mean(0), heading.cos().mean(0))
    start = rotations.yaw(actual[0, QUATERNION])
    values = _path_values(particles[:, 1:], start, middle)  # (S, K, 3)
    truth = _path_values(actual[1:], start, middle)  # (K, 3)
    ends = [central_interval(values, level) for level in levels]
    inside = torch.stack([(low <= truth) & (truth <= high) for low, high in ends])
    width = torch.stack([high - low for low, high in ends])
    return PathCoverage(inside, width, (values.mean(0) - truth).abs())


def central_interval(values: Tensor, level: float) -> tuple[Tensor, Tensor]:
    """Ends (...) of the interval that holds a new sample like (S, ...) with `level`."""
    count = len(values)
    low, high = (
        min(max((share * (count + 1) - 1) / (count - 1), 0.0), 1.0)
        for share in (0.5 - level / 2, 0.5 + level / 2)
    )
    return values.quantile(low, dim=0), values.quantile(high, dim=0)


def _path_values(states: Tensor, heading: Tensor, middle: Tensor) -> Tensor:
    """Position along and across a heading, m, and heading from `middle` (K,), rad.

    States (..., K, 13) give values (..., K, 3).
    """
    turn = rotations.wrap(rotations.yaw(states[..., QUATERNION]) - middle)
    position = rotations.turn(states[..., :2], -heading)
    return torch.cat([position, turn[..., None]], dim=-1)
