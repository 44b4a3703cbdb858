"""Stored rows that older code made and that today's code would make again: confirmed by a sample instead of hours.

Of every kind of stale trial the quickest is run again. The trials of a kind go the same ways through the code: they are
equal but for size, seed, and how large the numbers are that are not zero. Where the quickest comes out as it is stored,
to the last stored digit, all rows of its kind count as made by today's code, and say so.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import Any, NamedTuple

from sidm.experiments.measure import run_trial
from sidm.experiments.provenance import source_hash
from sidm.experiments.store import Results, Row, rounded
from sidm.experiments.trials import Trial
from sidm.progress import progress_bar


class Confirmed(NamedTuple):
    """What came of it."""

    rows: int  # that now count as today's
    differing: list[Trial]  # that were run again and came out otherwise; they and their kinds stay stale


def candidates(trials: Iterable[Trial], store: Results) -> list[list[Row]]:
    """Stale rows by kind, the quickest first: not of bundles, and made from data that today's code would make."""
    kinds: dict[tuple, list[Row]] = {}
    for row in store.rows(trials):
        made = row.provenance
        if row.stale and not made.bundle and made.simulation_source == source_hash("simulation"):
            kinds.setdefault((kind(row.trial), made.learning_source), []).append(row)
    return [sorted(rows, key=lambda row: row.provenance.seconds) for rows in kinds.values()]


def kind(trial: Trial) -> str:
    """What a trial has in common with those of its kind."""

    def choices(values: Any) -> Any:
        if isinstance(values, dict):
            return {name: choices(value) for name, value in values.items()}
        return values if isinstance(values, str | bool | None) else bool(values)

    return json.dumps(choices(trial.replace(seed=0).to_json()), sort_keys=True)


def same(row: Row, again: Row) -> bool:
    """Whether two rows have the same outcome to the digits that are stored."""
    stored, found = (rounded(dataclasses.asdict(one.outcome)) for one in (row, again))  # type: ignore[call-overload]
    return stored == found


def confirm(
    trials: Iterable[Trial], store: Results, executor: Executor, data: str | Path = "data", progress: bool = True
) -> Confirmed:
    """Run one of each kind of stale row again, and mark the kinds that come out the same.

    Args:
        trials: whose rows are looked at.
        store: where they are.
        executor: where the trials run; on another machine or PyTorch they seldom come out the same to the last digit.
        data: the folder of the shards.
        progress: whether to show a bar.
    """
    kinds = candidates(trials, store)
    futures = {executor.submit(run_trial, alike[0].trial, Path(data).absolute()): alike for alike in kinds}
    rows, differing = 0, []
    with progress_bar(len(kinds), "kinds", "trial", progress) as bar:
        for done in as_completed(futures):
            alike, again = futures[done], done.result()
            if isinstance(again, Row) and same(alike[0], again):
                for number, row in enumerate(alike):
                    how = "sample" if number else "rerun"
                    made = dataclasses.replace(
                        row.provenance, confirmed_source=again.provenance.learning_source, confirmed_by=how
                    )
                    store.put(dataclasses.replace(row, provenance=made))
                rows += len(alike)
            else:
                differing.append(alike[0].trial)
            bar.update()
    return Confirmed(rows, differing)
