"""How long to train: far past the preset's patience, on a small dataset.

The dataset is one that settings are chosen by, not one of a figure.
"""

from __future__ import annotations

from typing import Any

import pandas as pd

from companion.engine.store import Results
from companion.methods import COMPARED, METHODS
from companion.statistics.pairs import paired_comparison
from companion.study import Study
from companion.trials import Trial
from sidm.config import replace

#: The paper's amount of expert motion, and novice motion that settings are chosen by.
MOTION: dict[str, Any] = {
    "expert_minutes": 500_000 / 600,
    "rollouts": 100,
    "tuning_pool_minutes": 60.0,
}
#: Training goes on until so many samples bring no lower test loss.
LONG: dict[str, Any] = {"patience": 2_500_000, "max_samples": 6_000_000}
MINUTES, SEEDS = (5.0,), 3
MANY_EXPERTS = 0.9  # p_e


def trials(study: Study, system: str) -> list[Trial]:
    """The paper's methods trained for long with this book's settings.

    SIDM is also trained for long at a p_e of MANY_EXPERTS.
    """
    long = Study(study.preset.replace(**MOTION).for_tuning().replace(**LONG))
    sidm = long.preset.training_of(METHODS["sidm"], system)
    many_experts = replace(sidm, p_expert=MANY_EXPERTS)
    trials = long.points(system, COMPARED, MINUTES, seeds=SEEDS)
    return trials + long.points(system, ["sidm"], MINUTES, many_experts, SEEDS)


def ratio_of_many_experts(study: Study, store: Results) -> pd.DataFrame:
    """The SIDM's loss with a p_e of MANY_EXPERTS by that with the usual one."""
    frame = store.frame(trials(study, "system1"))
    sidm = frame[frame.method == "sidm"]
    many = sidm.p_expert == MANY_EXPERTS
    return paired_comparison(sidm[many], sidm[~many], by=["p_expert"])
