"""The same trials on data that were made again on another machine: what its rounding does to their losses.

A store of such trials lies in results/reproduction, under the digests of its own data.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from companion.engine.frame import frame_of
from companion.engine.store import Results
from companion.statistics.pairs import beside
from companion.trials import Trial


def store_of(results: str | Path = "results") -> Results:
    """Where the trials on other data are kept."""
    return Results(Path(results) / "reproduction")


def table(stored: Results, again: Results) -> pd.DataFrame:
    """Losses of one store beside those of another, of the trials that differ in their data alone: `pairs.beside`."""
    own, other = (
        {_but_for_data(row.trial): row for row in store.all()}
        for store in (stored, again)
    )
    both = own.keys() & other.keys()
    there, here = (
        frame_of(side[trial] for trial in sorted(both)) for side in (other, own)
    )
    return beside(there, here, ["system", "novice_minutes", "method"])


def _but_for_data(trial: Trial) -> str:
    return trial.replace(**{f"{kind}_data": "any" for kind in trial.digests}).key
