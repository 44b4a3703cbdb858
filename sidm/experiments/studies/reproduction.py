"""The same trials on data that were made again on another machine: what its rounding does to their losses.

A store of such trials lies in results/again, under the digests of its own data.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sidm.experiments.engine.store import Results, Row
from sidm.experiments.methods import METHODS
from sidm.experiments.statistics.intervals import Interval, ratio_of_means


class Again(NamedTuple):
    """A method at one size, on the data of the results and on those made again, the same seeds."""

    system: str
    method: str
    minutes: float
    seeds: int
    stored: float  # mean validation loss
    again: float
    ratio: Interval  # of the second to the first, paired by seed


def store_of(results: str | Path = "results") -> Results:
    """Where the trials on other data are kept."""
    return Results(Path(results) / "again")


def compared(store: Results, again: Results) -> list[Again]:
    """A line a system, method and size of which both sides are stored."""
    known = {_but_for_data(row): row for row in store.all()}
    pairs: dict[tuple[str, str, float], list[tuple[float, float]]] = {}
    for row in again.all():
        own = known.get(_but_for_data(row))
        if own is not None:
            key = row.trial.system, row.trial.method, row.trial.novice_minutes
            pairs.setdefault(key, []).append((own.outcome.validation_loss, row.outcome.validation_loss))
    lines = []
    for key in _in_order(pairs):
        values = np.array(pairs[key])
        stored, made_again = values.mean(0).tolist()
        lines.append(Again(*key, len(values), stored, made_again, ratio_of_means(values)))
    return lines


def _but_for_data(row: Row) -> str:
    return row.trial.replace(**{f"{kind}_data": "any" for kind in row.trial.digests}).key


def _in_order(keys: Iterable[tuple[str, str, float]]) -> list[tuple[str, str, float]]:
    order = list(METHODS)
    return sorted(keys, key=lambda key: (key[0], key[2], order.index(key[1])))
