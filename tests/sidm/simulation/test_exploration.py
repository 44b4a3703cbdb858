"""The exploration policies."""

import numpy as np
import pytest

from sidm.config import ConfigError
from sidm.simulation import POLICIES, draw_actions


@pytest.mark.parametrize("policy", POLICIES)
def test_actions_are_bounded_and_seeded_and_only_held_ones_stand_still(policy):
    drawn = [
        draw_actions(policy, 64, np.random.default_rng(seed)) for seed in (1, 1, 2)
    ]
    assert drawn[0].shape == (64, 2) and np.abs(drawn[0]).max() <= 1
    assert np.array_equal(drawn[0], drawn[1])
    assert not np.array_equal(drawn[0], drawn[2])
    assert (np.ptp(drawn[0], axis=0).max() == 0) == (policy == "held")


def test_ornstein_uhlenbeck_throttle_has_the_stated_mean_and_steering_wanders_widely():
    rngs = map(np.random.default_rng, range(60))
    actions = np.stack([draw_actions("ornstein_uhlenbeck", 64, rng) for rng in rngs])
    assert actions[..., 0].mean() == pytest.approx(0.2, abs=0.05)
    # an unclipped throttle has the stationary deviation 0.025 / sqrt(2 * 0.0125)
    deviation = 0.025 / np.sqrt(2 * 0.0125)
    assert actions[:, 20:, 0].std() == pytest.approx(deviation, rel=0.25)
    assert actions[:, -1, 1].std() > 0.5


def test_an_unknown_policy_is_named_with_the_nearest():
    with pytest.raises(ConfigError, match="ornstein_uhlenbek.*ornstein_uhlenbeck"):
        draw_actions("ornstein_uhlenbek", 4, np.random.default_rng(0))
