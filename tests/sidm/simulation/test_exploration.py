"""The exploration policies."""

import numpy as np
import pytest

from sidm.config import ConfigError
from sidm.simulation import POLICIES, draw_actions


@pytest.mark.parametrize("policy", POLICIES)
def test_actions_are_bounded_and_seeded(policy):
    first = draw_actions(policy, 64, np.random.default_rng(1))
    assert first.shape == (64, 2) and np.abs(first).max() <= 1
    assert np.array_equal(first, draw_actions(policy, 64, np.random.default_rng(1)))
    assert not np.array_equal(first, draw_actions(policy, 64, np.random.default_rng(2)))


def test_held_actions_are_held_and_the_others_move():
    for policy in POLICIES:
        still = (
            np.ptp(draw_actions(policy, 64, np.random.default_rng(3)), axis=0).max()
            == 0
        )
        assert still == (policy == "held")


def test_ornstein_uhlenbeck_throttle_has_the_stated_mean_and_steering_wanders_widely():
    actions = np.stack(
        [
            draw_actions("ornstein_uhlenbeck", 64, np.random.default_rng(k))
            for k in range(60)
        ]
    )
    assert actions[..., 0].mean() == pytest.approx(0.2, abs=0.05)
    # an unclipped throttle has the stationary deviation 0.025 / sqrt(2 * 0.0125)
    assert actions[:, 20:, 0].std() == pytest.approx(
        0.025 / np.sqrt(2 * 0.0125), rel=0.25
    )
    assert actions[:, -1, 1].std() > 0.5


def test_an_unknown_policy_is_named_with_the_nearest():
    with pytest.raises(ConfigError, match="ornstein_uhlenbek.*ornstein_uhlenbeck"):
        draw_actions("ornstein_uhlenbek", 4, np.random.default_rng(0))
