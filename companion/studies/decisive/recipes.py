"""What the decisive experiment's trainings have in common, and the recipe R: training as the released code does it."""

from __future__ import annotations

from typing import Any

from companion.methods import ALL_RELEASED, RELEASED
from companion.studies.duration import RELEASED_PACE
from companion.study import Study

#: The paper's motion of the expert; no settings of older studies; 128 validation
#: trajectories (13.7 min) at every test.
COMMON: dict[str, Any] = {
    "expert_minutes": 500_000 / 600,
    "rollouts": 100,
    "validation_trajectories": 128,
    "tuned": (),
}
POOL_MINUTES, VALIDATION_MINUTES = 120.0, 60.0  # of fresh motion of the novice

#: Changes of a preset for R, beside its networks at 32 pixels.
R: dict[str, Any] = (
    RELEASED[ALL_RELEASED][0]
    | RELEASED_PACE
    | {
        "units": "raw",
        "zero_gradients": True,
        "replacement": False,
        "discriminator_draw": "one",
    }
)


def to_the_cap(samples: int) -> dict[str, int]:
    """Changes of a preset whose trainings nothing stops before so many samples."""
    return {"max_samples": samples, "patience": samples}


def on_tuning_motion(study: Study) -> Study:
    """The preset on motion that only settings are chosen by: a pool of 60 min, 20 min of validation."""
    return study.of(
        study.preset.replace(**COMMON, tuning_pool_minutes=60.0).for_tuning()
    )


def on_fresh_motion(study: Study) -> Study:
    """The preset on motion of the novice that nothing was chosen by."""
    return study.of(
        study.preset.replace(**COMMON).with_motion(
            "decisive", POOL_MINUTES, VALIDATION_MINUTES
        )
    )
