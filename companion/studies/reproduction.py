"""How much the rounding of another machine changes losses: the same trials, new data.

The data were simulated again on that machine. A store of such trials lies in
`results/reproduction`, under the digests of its own data.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd

from companion.engine.frame import frame_of
from companion.engine.store import Results
from companion.statistics.pairs import MOTION, paired_comparison
from companion.training import StudyTraining
from companion.trials import Trial
from sidm.settings import Network


def store_of(results: str | Path = "results") -> Results:
    """The store of the trials on the other machine's data."""
    return Results(Path(results) / "reproduction")


def with_repeats(reference: pd.DataFrame, results: str | Path) -> pd.DataFrame:
    """Results to compare with, and the same trials on the other machine's data.

    Args:
        reference: stored results, as `Results.frame` gives them.
        results: folder of the results.

    Returns:
        The rows with the column `pairs.MOTION`, so that `pairs.paired_comparison` takes
        those on the same motion.
    """
    rows = frame_of(store_of(results).all())
    first = reference.assign(**{MOTION: False})
    if not len(rows) or not len(reference):
        return first
    keys = _settings(reference)
    again = rows[_settings(rows).isin(set(keys)).to_numpy()]
    return pd.concat([first, again.assign(**{MOTION: True})])


def _settings(frame: pd.DataFrame) -> pd.Series:
    """What was trained, and how, as text; without the data's digests."""
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
    """Ratios of repeated to stored losses, of trials that differ only in their data.

    Returns:
        A table of `pairs.paired_comparison`, one row per system, method and size.
    """
    first, second = (
        {_key_without_data(row.trial): row for row in store.all()}
        for store in (stored, repeated)
    )
    both = sorted(first.keys() & second.keys())
    new, old = (frame_of(rows[key] for key in both) for rows in (second, first))
    return paired_comparison(new, old, ["system", "novice_minutes", "method"])


def _key_without_data(trial: Trial) -> str:
    """The trial's key as if all its datasets had the same digest."""
    return trial.replace(**{f"{kind}_data": "any" for kind in trial.digests}).key
