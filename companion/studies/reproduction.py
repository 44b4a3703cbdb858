"""How much the rounding of another machine changes losses: the same trials, new data.

The data were simulated again on that machine. A store of such trials lies in
`results/reproduction`, under the digests of its own data.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from companion.engine.frame import frame_of
from companion.engine.store import Results
from companion.statistics.pairs import paired_comparison
from companion.trials import Trial


def store_of(results: str | Path = "results") -> Results:
    """The store of the trials on the other machine's data."""
    return Results(Path(results) / "reproduction")


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
