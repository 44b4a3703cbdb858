"""What choices are worth that the paper leaves open, or that the released code makes otherwise.

Figure 3's methods are trained with one choice changed at a time, on the small size of the ablations, as each was tuned.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from sidm.experiments.methods import CHOICES
from sidm.experiments.statistics import Interval, interval
from sidm.experiments.store import Results
from sidm.experiments.study import Study


class Worth(NamedTuple):
    """A choice changed."""

    system: str
    choice: str
    method: str
    seeds: int
    chosen: float  # mean validation loss as chosen
    changed: float  # and as changed
    ratio: Interval  # changed by chosen, above 1 where the choice is the better


def worth(study: Study, systems: Iterable[str], store: Results) -> list[Worth]:
    """A line a system, choice and method of which both sides are stored."""
    found = []
    for system in systems:
        for choice, (changes, methods) in CHOICES.items():
            for method in methods:
                pairs = _pairs(study, system, method, changes, store)
                if len(pairs):
                    chosen, changed = pairs.mean(0).tolist()
                    ratio = Interval(*np.exp(interval(_log_ratio, pairs)))
                    found.append(Worth(system, choice, method, len(pairs), chosen, changed, ratio))
    return found


def _log_ratio(pairs: np.ndarray) -> float:
    """Logarithm of mean changed by mean chosen of losses (S, 2)."""
    chosen, changed = pairs.mean(0)
    return float(np.log(changed / chosen))


def _pairs(study: Study, system: str, method: str, changes: dict[str, Any], store: Results) -> np.ndarray:
    """Validation losses (S, 2) as chosen and as changed, of the seeds that have both."""
    losses = []
    for one in (study, study.changed(**changes)):
        rows = store.rows(one.points(system, [method], study.preset.ablation_minutes[:1]))
        losses.append({row.trial.seed: row.outcome.validation_loss for row in rows})
    return np.array([[side[seed] for side in losses] for seed in sorted(losses[0].keys() & losses[1].keys())])
