"""The jitter of recorded poses, and the least loss that a model can have with it.

A robot's path is smooth over a few steps; noise of the pose, drawn anew at each step,
is not. Differences of fourth order remove what is smooth, and turn white noise of
variance s^2 into variance 70 s^2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from companion.studies.real_robots.measure import HORIZON, WARM_UP
from sidm.drives import Drive
from sidm.learning.dataset import states_and_actions, windows_of
from sidm.learning.units import Standardisation, loss_weights
from sidm.rotations import turn

ORDER = 4  # of the differences
#: variance of these differences of white noise of variance 1: the squares of the
#: binomial coefficients, whose sum is the middle one of twice the order
VARIANCE_FACTOR = math.comb(2 * ORDER, ORDER)
DRAWS, SEED = 20, 0  # draws of the noise for each window, and their seed


class Floor(NamedTuple):
    """The errors of a model that knows the motion, due to jitter alone.

    The first value of each pair is the least error possible. The second is the error of
    a model that does not know the noise of the last pose.
    """

    loss: tuple[float, float]  # equation (1), each component by its variance
    displacement: tuple[float, float]  # m, mean, after HORIZON steps open loop
    heading: tuple[float, float]  # rad, mean, after HORIZON steps open loop


def jitter(windows: Sequence[Drive]) -> np.ndarray:
    """Standard deviations (3,) of a pose's noise: forward, m, left, m, heading, rad."""
    x, y, yaw = states_and_actions(windows)[0][..., :3].numpy().transpose(2, 0, 1)
    yaw = np.unwrap(yaw, axis=1)
    dx, dy, dyaw = (np.diff(values, n=ORDER, axis=1) for values in (x, y, yaw))
    heading = yaw[:, ORDER // 2 : -ORDER // 2]
    forward = np.cos(heading) * dx + np.sin(heading) * dy
    left = np.cos(heading) * dy - np.sin(heading) * dx
    variances = [
        np.square(values).mean() / VARIANCE_FACTOR for values in (forward, left, dyaw)
    ]
    return np.sqrt(variances)


def floor(windows: Sequence[Drive]) -> Floor:
    """The errors due to the jitter of a robot's planar poses.

    A step's change has the noise of the pose after it, which nothing before can tell,
    and that of the pose before it, which the earlier steps could tell. The same holds
    open loop, where noise of the first heading turns the whole path.
    """
    noise, states = jitter(windows), states_and_actions(windows)[0]
    units = Standardisation.fit(windows_of(windows, 0))
    weights = loss_weights(windows[0].body, units)
    assert weights is not None
    least = float((weights[:3].numpy() * noise**2).sum())
    rng = np.random.default_rng(SEED)
    # (DRAWS, N, 3) noise of the first and of the last pose
    first, last = rng.normal(size=(2, DRAWS, len(states), 3)) * noise
    start, end = states[:, WARM_UP], states[:, WARM_UP + HORIZON]
    # (N, 2) m, in the frame of the first pose
    way = turn((end - start)[:, :2], -start[:, 2]).numpy()
    turned = np.stack([-way[:, 1] * first[..., 2], way[:, 0] * first[..., 2]], -1)
    no_heading = np.zeros_like(turned[..., :1])
    both = last - first - np.concatenate([turned, no_heading], -1)
    displacements, headings = [], []
    for errors in (last, both):
        displacements.append(float(np.linalg.norm(errors[..., :2], axis=-1).mean()))
        headings.append(float(np.abs(errors[..., 2]).mean()))
    return Floor((least, 2 * least), tuple(displacements), tuple(headings))  # type: ignore[arg-type]
