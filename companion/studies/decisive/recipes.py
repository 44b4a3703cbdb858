"""What the decisive experiment's trainings have in common, and recipe R.

Recipe R trains as the released code does.
"""

from __future__ import annotations

from typing import Any

from companion.methods import ALL_RELEASED, RELEASED
from companion.study import Study

#: The expert has as much motion as in the paper; no settings of older studies; 128
#: validation trajectories (13.7 min) at every test.
COMMON: dict[str, Any] = {
    "expert_minutes": 500_000 / 600,
    "rollouts": 100,
    "validation_trajectories": 128,
    "tuned": (),
}
POOL_MINUTES, VALIDATION_MINUTES = 120.0, 60.0  # fresh motion of the novice

#: Changes of a preset for recipe R; its networks take maps of 32 pixels. The test loss
#: is taken after as many samples as in this book's trainings.
R: dict[str, Any] = RELEASED[ALL_RELEASED][0] | {
    "batch": 2,
    "discriminator_batch": 2,
    "matching_batch": 2,
    "learning_rate": 1e-4,
    "test_interval": 100,
    "units": "raw",
    "zero_gradients": True,
    "replacement": False,
    "discriminator_draw": "one",
}


def without_early_stopping(samples: int) -> dict[str, int]:
    """Changes of a preset with which every training goes on to so many samples."""
    return {"max_samples": samples, "patience": samples}


def on_tuning_motion(study: Study) -> Study:
    """The study on motion that serves only the choice of settings.

    Settings are chosen on a pool of 60 min and 20 min of validation motion.
    """
    preset = study.preset.replace(**COMMON, tuning_pool_minutes=60.0)
    return Study(preset.for_tuning())


def on_fresh_motion(study: Study) -> Study:
    """The study on motion of the novice by which no setting was chosen."""
    preset = study.preset.replace(**COMMON)
    fresh = preset.with_motion("decisive", POOL_MINUTES, VALIDATION_MINUTES)
    return Study(fresh)
