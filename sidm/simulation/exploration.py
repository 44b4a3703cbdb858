"""Exploration policies: random actions that a robot is driven with.

Three policies are those of the authors' released code; `held` is the constant action of
Figure 4. No policy looks at the robot's state, so the actions of a whole trajectory are
drawn at once.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sidm.config import unknown_name

SUBSTEPS = 50  # steps of the Ornstein-Uhlenbeck process in one control step


def ornstein_uhlenbeck(steps: int, rng: np.random.Generator) -> np.ndarray:
    """Actions (T, 2) of a mean-reverting random walk behind a low-pass filter.

    The walk has 50 substeps in a control step. The released code had this policy
    at the time of the paper.
    """
    shocks = rng.normal(0.0, (0.025, 0.05), (steps * SUBSTEPS, 2))
    throttle = _filtered_walk(shocks[:, 0].tolist(), mean=0.2, pull=0.0125, keep=0.8)
    steering = _filtered_walk(shocks[:, 1].tolist(), mean=0.0, pull=0.001, keep=0.99)
    return np.array([throttle, steering]).T[SUBSTEPS - 1 :: SUBSTEPS]


def _filtered_walk(
    shocks: list[float], mean: float, pull: float, keep: float
) -> list[float]:
    """A random walk with a pull to its mean, low-pass filtered, within [-1, 1]."""
    walk = smooth = 0.0
    outputs = []
    for shock in shocks:
        walk = walk + pull * (mean - walk) + shock
        smooth = min(max(keep * smooth + (1 - keep) * walk, -1.0), 1.0)
        outputs.append(smooth)
    return outputs


def sinusoid(steps: int, rng: np.random.Generator) -> np.ndarray:
    """Actions (T, 2): sines whose phases advance by random amounts."""
    return np.sin(np.cumsum(rng.normal((0.1, 0.5), (0.01, 0.2), (steps, 2)), axis=0))


def bounded_noise(steps: int, rng: np.random.Generator) -> np.ndarray:
    """Actions (T, 2): tanh of a fast mean-reverting walk behind a low-pass filter."""
    walk, smooth, actions = np.zeros(2), np.zeros(2), np.empty((steps, 2))
    for step, shock in enumerate(rng.normal(0.0, 0.5, (steps, 2))):
        walk = 0.9 * walk + shock
        smooth = 0.8 * smooth + 0.2 * walk
        actions[step] = np.tanh(smooth)
    return actions


def held(steps: int, rng: np.random.Generator) -> np.ndarray:
    """Actions (T, 2): one action, uniform over the square, at all steps (Figure 4)."""
    return np.tile(rng.uniform(-1, 1, 2), (steps, 1))


POLICIES: dict[str, Callable[[int, np.random.Generator], np.ndarray]] = {
    policy.__name__: policy
    for policy in (ornstein_uhlenbeck, sinusoid, bounded_noise, held)
}


def draw_actions(policy: str, steps: int, rng: np.random.Generator) -> np.ndarray:
    """Actions (steps, 2), (throttle, steering) in [-1, 1], by one of POLICIES."""
    if policy not in POLICIES:
        raise unknown_name(policy, POLICIES, kind="exploration policy")
    return POLICIES[policy](steps, rng)
