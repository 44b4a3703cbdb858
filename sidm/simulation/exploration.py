"""Random actions that explore: three policies of the authors' released code, and the held action of Figure 4.

None looks at the robot's state, so a whole trajectory's actions are drawn at once.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sidm.config import unknown_name

SUBSTEPS = 50  # of the Ornstein-Uhlenbeck process in a control step


def ornstein_uhlenbeck(steps: int, rng: np.random.Generator) -> np.ndarray:
    """Actions (T, 2) of a mean-reverting walk, low-pass filtered, 50 substeps a control step; the paper's data."""
    shocks = rng.normal(0.0, (0.025, 0.05), (steps * SUBSTEPS, 2))
    throttle = _filtered_walk(shocks[:, 0].tolist(), mean=0.2, pull=0.0125, keep=0.8)
    steering = _filtered_walk(shocks[:, 1].tolist(), mean=0.0, pull=0.001, keep=0.99)
    return np.array([throttle, steering]).T[SUBSTEPS - 1 :: SUBSTEPS]


def _filtered_walk(
    shocks: list[float], mean: float, pull: float, keep: float
) -> list[float]:
    """A walk pulled towards its mean, seen through a low-pass filter that keeps within [-1, 1], after each shock."""
    walk = smooth = 0.0
    seen = []
    for shock in shocks:
        walk = walk + pull * (mean - walk) + shock
        smooth = min(max(keep * smooth + (1 - keep) * walk, -1.0), 1.0)
        seen.append(smooth)
    return seen


def sinusoid(steps: int, rng: np.random.Generator) -> np.ndarray:
    """Actions (T, 2): sines whose phases advance at random."""
    return np.sin(np.cumsum(rng.normal((0.1, 0.5), (0.01, 0.2), (steps, 2)), axis=0))


def bounded_noise(steps: int, rng: np.random.Generator) -> np.ndarray:
    """Actions (T, 2) of a quick mean-reverting walk, low-pass filtered and bounded by a hyperbolic tangent."""
    walk, smooth, actions = np.zeros(2), np.zeros(2), np.empty((steps, 2))
    for step, shock in enumerate(rng.normal(0.0, 0.5, (steps, 2))):
        walk = 0.9 * walk + shock
        smooth = 0.8 * smooth + 0.2 * walk
        actions[step] = np.tanh(smooth)
    return actions


def held(steps: int, rng: np.random.Generator) -> np.ndarray:
    """Actions (T, 2): one, uniform over the square, held throughout (Figure 4)."""
    return np.tile(rng.uniform(-1, 1, 2), (steps, 1))


POLICIES: dict[str, Callable[[int, np.random.Generator], np.ndarray]] = {
    policy.__name__: policy
    for policy in (ornstein_uhlenbeck, sinusoid, bounded_noise, held)
}


def draw_actions(policy: str, steps: int, rng: np.random.Generator) -> np.ndarray:
    """Actions (steps, 2), each (throttle, steering) in [-1, 1], of the named policy; ConfigError without one."""
    if policy not in POLICIES:
        raise unknown_name(policy, POLICIES, "the exploration policies")
    return POLICIES[policy](steps, rng)
