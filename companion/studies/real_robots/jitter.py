"""What the sensors allow: the jitter of recorded poses, and what it alone costs a model that knows the motion.

A robot's path is smooth over a few steps; noise of the pose, drawn anew at each, is
not. Differences of fourth order take away what is smooth, and of white noise of
variance s^2 leave 70 s^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from companion.studies.real_robots.measure import HORIZON, WARM_UP
from sidm.drives import Drive
from sidm.learning.dataset import stacked, windows_of
from sidm.learning.units import Standardisation, loss_weights
from sidm.rotations import turn

ORDER, NOISE = 4, 70.0  # of the differences, and what they make of a variance
DRAWS, SEED = 20, 0  # of the noise, for each piece


class Floor(NamedTuple):
    """What jitter costs at least, and what it costs a model that does not see how far off the last pose was."""

    loss: tuple[float, float]  # of equation (1), each component by its variance
    displacement: tuple[float, float]  # m, mean, after HORIZON steps open loop
    heading: tuple[float, float]  # rad


def jitter(windows: Sequence[Drive]) -> np.ndarray:
    """Standard deviations (3,) of a planar pose's noise: forward, m, to the left, m, and heading, rad."""
    x, y, yaw = stacked(windows)[0][..., :3].numpy().transpose(2, 0, 1)
    yaw = np.unwrap(yaw, axis=1)
    across, along, turned = (np.diff(one, n=ORDER, axis=1) for one in (x, y, yaw))
    heading = yaw[:, ORDER // 2 : -ORDER // 2]
    forward = np.cos(heading) * across + np.sin(heading) * along
    left = np.cos(heading) * along - np.sin(heading) * across
    return np.sqrt([np.square(one).mean() / NOISE for one in (forward, left, turned)])


def floor(windows: Sequence[Drive]) -> Floor:
    """What the jitter of a robot's planar poses costs.

    A step's change is off by the noise of the pose after it, which nothing before can
    tell, and by that of the pose before it, which the steps until then could. So it is
    open loop, where noise of the first heading turns the path.
    """
    noise, states = jitter(windows), stacked(windows)[0]
    weights = loss_weights(windows[0].body, Standardisation.of(windows_of(windows, 0)))
    assert weights is not None
    least = float((weights[:3].numpy() * noise**2).sum())
    rng = np.random.default_rng(SEED)
    first, last = rng.normal(size=(2, DRAWS, len(states), 3)) * noise
    start, end = states[:, WARM_UP], states[:, WARM_UP + HORIZON]
    # (N, 2) m, in the first one's frame
    way = turn((end - start)[:, :2], -start[:, 2]).numpy()
    turned = np.stack([-way[:, 1] * first[..., 2], way[:, 0] * first[..., 2]], -1)
    ends = (
        last,
        last - first - np.concatenate([turned, np.zeros_like(turned[..., :1])], -1),
    )
    displacement = tuple(
        float(np.linalg.norm(one[..., :2], axis=-1).mean()) for one in ends
    )
    heading = tuple(float(np.abs(one[..., 2]).mean()) for one in ends)
    return Floor((least, 2 * least), displacement, heading)  # type: ignore[arg-type]
