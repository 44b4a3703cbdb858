"""What choices are worth that the paper leaves open, or that the released code makes otherwise.

Figure 3's methods are trained with one choice changed at a time, on the small size of the ablations, as each was tuned;
and with the released code's choices together, at every size.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from sidm.experiments.engine.store import Results
from sidm.experiments.methods import CHOICES, RELEASED
from sidm.experiments.statistics.intervals import Interval, ratio_of_means
from sidm.experiments.study import Study


class Worth(NamedTuple):
    """A choice changed."""

    system: str
    choice: str
    method: str
    minutes: float  # of novice data
    seeds: int
    chosen: float  # mean validation loss as chosen
    changed: float  # and as changed
    ratio: Interval  # changed by chosen, above 1 where the choice is the better


def worth(study: Study, systems: Iterable[str], store: Results) -> list[Worth]:
    """A line a system, choice and method of which both sides are stored, on the small size."""
    size = study.preset.ablation_minutes[0]
    return [
        one
        for system in systems
        for words, (changes, methods) in CHOICES.items()
        for method in methods
        for one in _worth(study, store, system, words, changes, method, size)
    ]


def worth_together(study: Study, systems: Iterable[str], store: Results) -> list[Worth]:
    """The same of the released code's choices together, a line a size."""
    return [
        one
        for system in systems
        for words, (changes, methods) in RELEASED.items()
        for method in methods
        for minutes in study.preset.novice_minutes(system)
        for one in _worth(study, store, system, words, changes, method, minutes)
    ]


def _worth(
    study: Study, store: Results, system: str, choice: str, changes: dict[str, Any], method: str, minutes: float
) -> list[Worth]:
    """One line, of the seeds that have both sides; none where no seed has."""
    losses = []
    for one in (study, study.changed(**changes)):
        rows = store.rows(one.points(system, [method], [minutes]))
        losses.append({row.trial.seed: row.outcome.validation_loss for row in rows})
    seeds = sorted(losses[0].keys() & losses[1].keys())
    if not seeds:
        return []
    pairs = np.array([[side[seed] for side in losses] for seed in seeds])  # (S, 2)
    chosen, changed = pairs.mean(0).tolist()
    return [Worth(system, choice, method, minutes, len(pairs), chosen, changed, ratio_of_means(pairs))]
