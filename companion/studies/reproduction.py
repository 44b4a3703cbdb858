"""How much the rounding of another machine changes losses: the same trials, new data.

The data were simulated again on that machine. A store of such trials lies in
`results/reproduction`, under the digests of its own data.
"""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from companion.engine.store import Results
from companion.methods import METHODS
from companion.statistics.pairs import MOTION, paired_comparison
from companion.training import StudyTraining
from companion.trials import Trial
from sidm.config import to_mapping
from sidm.settings import Network

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
    keys = _settings(reference)
    again = rows[_settings(rows).isin(set(keys)).to_numpy()]
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


def _settings(frame: pd.DataFrame) -> pd.Series:
    """A text of the settings of each result: all that a trial has but its data."""
    names = ["system", "method", "novice_minutes", "seed"]
    for kind in (Network, StudyTraining):
        names += [field.name for field in dataclasses.fields(kind)]
    known = [name for name in names if name in frame]
    return frame[known].map(_text).agg(" ".join, axis=1)


def _text(value: object) -> str:
    """A value as text; numbers of a column with gaps are floats, of others integers."""
    number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
    return f"{float(value):g}" if number else str(value)  # type: ignore[arg-type]


def table(stored: Results, repeated: Results) -> pd.DataFrame:
    """Ratios of repeated to stored losses, of trials that differ only in their data."""
    both = [row.trial for row in repeated.all() if stored.get(row.trial)]
    order = list(METHODS)
    both.sort(key=lambda t: (t.system, t.novice_minutes, order.index(t.method), t.seed))
    new, old = repeated.frame(both), stored.frame(both)
    return paired_comparison(new, old, ["system", "novice_minutes", "method"])


def unmatched(stored: Results, repeated: Results) -> dict[str, int]:
    """Why repeated trials have no counterpart among the stored ones.

    The reason, that is in what a trial differs from the stored one that is most like it
    -> how many trials it holds for, the commonest first.
    """
    points: dict[tuple, list[dict]] = {}
    for values in (_values(row.trial) for row in stored.all()):
        points.setdefault(_point(values), []).append(values)
    reasons: collections.Counter[str] = collections.Counter()
    for row in repeated.all():
        if stored.get(row.trial) is None:
            own = _values(row.trial)
            differing = [
                [
                    f"{name} {value} (there {other[name]})"
                    for name, value in own.items()
                    if name in other and value != other[name]
                ]
                for other in points.get(_point(own), [])
            ]
            nearest = min(differing, key=len, default=["no such method and size"])
            more = [f"{len(nearest) - NAMED} more"] * (len(nearest) > NAMED)
            reasons[", ".join([*nearest[:NAMED], *more])] += 1
    return dict(reasons.most_common())


def _point(values: dict[str, Any]) -> tuple:
    return values["system"], values["method"], values["novice_minutes"]


def _values(trial: Trial) -> dict[str, Any]:
    """The settings of a trial by name, those of its parts among them."""
    values = to_mapping(trial)
    values |= values.pop("network") | values.pop("training")
    before = values.pop("pretraining") or {}
    return values | {f"pretraining_{name}": value for name, value in before.items()}
