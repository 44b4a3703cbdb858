"""How long to train: far past the preset's patience, on a small dataset that settings are chosen by."""

from __future__ import annotations

from typing import Any

from sidm.experiments.methods import ALL_RELEASED, COMPARED, METHODS, RELEASED, change
from sidm.experiments.study import Study
from sidm.experiments.trials import Trial

#: Until so many samples bring no lower test loss.
LONG: dict[str, Any] = {"patience": 2_500_000, "max_samples": 6_000_000}
MINUTES, SEEDS = (5.0,), 3
MANY_EXPERTS = 0.9  # p_e
RELEASED_MINUTES = (5.0, 20.0, 1.0, 60.0)  # of system 1's novice, as the authors train; in the order of worth

#: Batches and rate of the authors' code, with a test as often in samples as ours.
RELEASED_PACE = dict(
    batch=2, discriminator_batch=2, matching_batch=2, learning_rate=1e-4, test_interval=100
)  # fmt: skip


def trials(study: Study, system: str) -> list[Trial]:
    """The paper's methods, with SIDM also at a p_e of MANY_EXPERTS; of system 1 also as the authors train them."""
    long = study.of(study.preset.for_tuning().replace(**LONG))
    more = change(METHODS["sidm"].training(long.preset, system), p_expert=MANY_EXPERTS)
    found = []
    for seed in range(SEEDS):
        firsts = long.points(system, COMPARED, MINUTES, seeds=1)
        firsts += long.points(system, ["sidm"], MINUTES, more, seeds=1)
        found += [first.replace(seed=seed) for first in firsts]
    if system == "system1":
        changes = RELEASED[ALL_RELEASED][0] | RELEASED_PACE
        found += long.changed(tuned=(), **changes).points(system, COMPARED, RELEASED_MINUTES, seeds=SEEDS)
    return found
