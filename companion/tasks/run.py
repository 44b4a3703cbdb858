"""Run methods on tasks: what is missing, in processes or on Dask, resumable."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from companion.engine.records import records_of
from companion.tasks.catalogue import SEEDS, Task, load_task
from companion.tasks.methods import find_method
from companion.tasks.trial import LIMIT, NO_FAILURE, Entry, EntryResult, run_trial
from sidm.config import ConfigError

#: The stored results, under a folder of results.
records = records_of(EntryResult, "benchmark")


def newest(
    results: str | Path = "results", here: Sequence[str] = ()
) -> list[EntryResult]:
    """The stored results; of a method's file those of its newest version alone."""
    rows = sorted(records(results).all(), key=lambda row: row.provenance.date)
    versions = {row.about.method: row.about.code for row in rows}
    versions |= dict(map(find_method, here))
    return [row for row in rows if versions[row.about.method] == row.about.code]


def entries(
    methods: Sequence[str], tasks: Sequence[Task], seeds: int = SEEDS
) -> dict[Entry, str]:
    """The trials of methods on tasks -> the method's name with its path."""
    found = {name: find_method(name) for name in methods}
    return {
        Entry(method=method, code=code, task=task, seed=seed): name
        for task in tasks
        for seed in range(seeds)
        for name, (method, code) in found.items()
    }


def run(
    methods: Sequence[str],
    tasks: Sequence[Task],
    *,
    seeds: int = SEEDS,
    data: str | Path = "data",
    results: str | Path = "results",
    workers: int = 1,
    limit: float = LIMIT,
    executor: Executor | None = None,
    progress: bool = True,
    retry: bool = False,
) -> list[EntryResult]:
    """Run the trials that are missing, and return the results of all."""
    store, wanted = records(results), entries(methods, tasks, seeds)
    missing = store.missing(wanted)
    if retry:
        failed = [row for row in store.stored(wanted) if row.status not in NO_FAILURE]
        missing = list(dict.fromkeys([*missing, *(row.about for row in failed)]))
    for task in dict.fromkeys(entry.task for entry in missing):
        # motion is simulated once, outside the limit of a trial
        load_task(task, 0, data, workers=workers, progress=progress)
    where: dict[str, Any] = {"data": data, "limit": limit, "folder": Path.cwd()}
    work = functools.partial(_one, names=wanted, **where)
    own = None if executor else ThreadPoolExecutor(workers)
    try:
        store.run(missing, work, executor or own, "benchmark", progress)  # type: ignore[arg-type]
    finally:
        if own is not None:
            own.shutdown(cancel_futures=True)
    return store.stored(wanted)


def _one(about: Entry, names: dict[Entry, str], **where: Any) -> EntryResult:
    return run_trial(about, names[about], **where)


def check(
    name: str,
    results: Sequence[EntryResult],
    data: str | Path = "data",
    workers: int = 1,
    limit: float = LIMIT,
) -> tuple[EntryResult, EntryResult]:
    """A stored trial of a method, and what it gives when it is run again.

    It is the quickest one; a failed one only if all are.
    """
    method = find_method(name)
    stored = [r for r in results if (r.about.method, r.about.code) == method]
    if not stored:
        raise ConfigError(f"no trial of {name} as it is now is stored for these tasks")
    chosen = min(stored, key=lambda row: (row.status != "ok", row.provenance.seconds))
    load_task(chosen.about.task, 0, data, workers=workers, progress=True)
    return chosen, run_trial(chosen.about, name, data, limit)
