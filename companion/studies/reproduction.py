"""How much the rounding of another machine changes losses: the same trials, new data.

The data were simulated again on that machine. A store of such trials lies in
`results/reproduction`, under the digests of its own data.
"""

from __future__ import annotations

import collections
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pandas as pd

from companion.engine.store import Results
from companion.methods import METHODS
from companion.statistics.pairs import MOTION, paired_comparison
from companion.statistics.tables import differences
from companion.trials import Trial

NAMED = 4  # settings that a reason names


def store_of(results: str | Path = "results") -> Results:
    """The store of the trials on the other machine's data."""
    return Results(Path(results) / "reproduction")


def with_repeats(reference: pd.DataFrame, results: str | Path) -> pd.DataFrame:
    """Results to compare with, and the same trials on the other machine's data.

    The rows have the column `pairs.MOTION`, so that `pairs.paired_comparison` takes
    those on the same motion.
    """
    rows = store_of(results).frame()
    first = reference.assign(**{MOTION: False})
    if not len(rows) or not len(reference):
        return first
    again = rows[rows.index.isin(reference.index)]
    return pd.concat([first, again.assign(**{MOTION: True})])


def retrained(records: Iterable[Any], things: str, results: str | Path) -> str:
    """How far the losses of models that a study trained again are from Figure 3's.

    `things` is what the models are, in the plural; records may be about no trial.
    """
    store, differences = Results(results), []
    for record in records:
        row = store.get(record.about.trial) if record.about.trial else None
        if row:
            difference = record.validation_loss - row.outcome.validation_loss
            differences.append(abs(difference))
    return (
        f"{len(differences)} {things} were trained for Figure 3, too: "
        f"their losses differ by at most {max(differences, default=0):.2g}"
    )


def table(stored: Results, repeated: Results) -> pd.DataFrame:
    """Ratios of repeated to stored losses, of trials that differ only in their data."""
    both = [row.trial for row in repeated.all() if stored.get(row.trial)]
    order = list(METHODS)
    both.sort(key=lambda t: (t.system, t.novice_minutes, order.index(t.method), t.seed))
    settings = [trial.replace(seed=0).key for trial in both]
    new, old = (
        store.frame(both).assign(settings=settings) for store in (repeated, stored)
    )
    point = ["system", "novice_minutes", "method", "settings"]
    return paired_comparison(new, old, point)


def unmatched(stored: Results, repeated: Results) -> dict[str, int]:
    """Why repeated trials have no counterpart among the stored ones.

    The reason, that is in what a trial differs from the stored one that is most like it
    -> how many trials it holds for, the commonest first.
    """
    points: dict[tuple, list[Trial]] = {}
    for row in stored.all():
        points.setdefault(_point(row.trial), []).append(row.trial)
    reasons: collections.Counter[str] = collections.Counter()
    for row in repeated.all():
        if stored.get(row.trial) is None:
            likely = points.get(_point(row.trial), [])
            reasons[_reason(row.trial, likely)] += 1
    return dict(reasons.most_common())


def _point(trial: Trial) -> tuple:
    return trial.system, trial.method, trial.novice_minutes


def _reason(trial: Trial, likely: Iterable[Trial]) -> str:
    """In what a trial differs from the one of some others that is most like it."""
    differing = [differences(trial, other) for other in likely]
    if not differing:
        return "no such method and size"
    nearest = min(differing, key=len)
    texts = [f"{name} {own} (there {there})" for name, (own, there) in nearest.items()]
    more = [f"{len(texts) - NAMED} more"] * (len(texts) > NAMED)
    return ", ".join([*texts[:NAMED], *more])
