"""Stale results that today's code would make again, confirmed by a sample instead of hours.

Of every kind of stale result the quickest is made again. The trials of a kind are equal but for size, seed, and how
large those numbers of their trainings are that are not zero. Where the quickest comes to its stored figures, but
for what rounding does on another machine, all results of its kind count as made by today's versions.
"""

from __future__ import annotations

import dataclasses
import functools
import json
from collections.abc import Callable, Iterable
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from sidm.experiments.engine.closed_form import run_trial
from sidm.experiments.engine.store import Failure, Results
from sidm.experiments.trials import Trial
from sidm.progress import progress_bar

if TYPE_CHECKING:
    from sidm.experiments.engine.records import Records

#: Relative difference that rounding may make: a training doubles it every few iterations, and may stop elsewhere.
#: Nine trials on motion that another processor simulated differ by up to 0.03 (results/again).
ROUNDING = 0.1


class Confirmed(NamedTuple):
    """What came of it."""

    confirmed: int  # results that now count as today's
    differing: list[Any]  # what they are of that came out otherwise; their kinds stay stale


def stale_kinds(results: Iterable[Any]) -> list[list[Any]]:
    """Stale rows, diagnoses or records by kind and versions, the quickest first; not those of bundles."""
    kinds: dict[tuple, list[Any]] = {}
    for one in results:
        if one.provenance.stale and not one.provenance.bundle:
            kinds.setdefault((kind(_subject(one)), str(one.provenance.numerics)), []).append(one)
    return [sorted(group, key=lambda one: one.provenance.seconds) for group in kinds.values()]


def _subject(one: Any) -> Any:
    """What a row or a diagnosis is of, a trial; or what a record is about."""
    return one.about if hasattr(one, "about") else one.trial


NO_KIND = ("seed", "episodes")  # fields of a record's subject in which those of a kind may differ


def kind(subject: Any) -> str:
    """What a trial or a record's subject has in common with those of its kind, as text.

    Of a trial, all but size, seed, and numbers of its trainings; of a record's subject, all but NO_KIND, and of its
    trial the same.
    """
    if isinstance(subject, Trial):
        return _kind_of_trial(subject)
    values = {name: value for name, value in dataclasses.asdict(subject).items() if name not in NO_KIND}
    trial = getattr(subject, "trial", None)
    return json.dumps(values | {"trial": trial and _kind_of_trial(trial)}, sort_keys=True)


def _kind_of_trial(trial: Trial) -> str:
    def ways(training: dict[str, Any] | None) -> dict[str, Any] | None:
        if training is None:
            return None
        known = {name: value if isinstance(value, str | bool) else bool(value) for name, value in training.items()}
        p = training["p_expert"]
        return known | {"p_expert": p if p in (0, 1) else "between"}

    values = trial.replace(seed=0, novice_minutes=trial.pool_minutes).to_json()
    return json.dumps(values | {name: ways(values[name]) for name in ("training", "pretraining")}, sort_keys=True)


COMPARED = ("validation_loss", "length")  # of a row's outcome, a diagnosis or a record: those that it has


def same(one: Any, again: Any) -> bool:
    """Whether two results of the same subject have the same figures but for rounding."""
    if isinstance(again, Failure):
        return False
    stored, made = (getattr(each, "outcome", each) for each in (one, again))
    figures = [[np.mean(getattr(one, name)) for one in (stored, made)] for name in COMPARED if hasattr(stored, name)]
    return all(abs(new - old) <= ROUNDING * old for old, new in figures)


def confirm(
    trials: Iterable[Trial], store: Results, executor: Executor, data: str | Path = "data", progress: bool = True
) -> Confirmed:
    """Run one of each kind of stale row again, and mark the kinds that come out the same.

    Rows that lie under the keys of older code move to today's first.

    Args:
        trials: whose rows are looked at.
        store: where they are.
        executor: where the trials run.
        data: the folder of the shards.
        progress: whether to show a bar.
    """
    store.rekey()
    work = functools.partial(run_trial, data=Path(data).absolute())
    return make_again(store.rows(trials), executor, work, store.put, progress)


def confirm_records(
    abouts: Iterable[Any], records: Records, work: Callable[[Any], Any], executor: Executor, progress: bool = True
) -> Confirmed:
    """The same for the records of a study; `work` makes one again."""
    return make_again(records.stored(abouts), executor, work, records.put, progress)


def make_again(
    results: Iterable[Any], executor: Executor, work: Callable[[Any], Any], put: Callable[[Any], Any], progress: bool
) -> Confirmed:
    """Make the first of each stale kind again; where it is the same, `put` all of the kind with today's versions."""
    kinds = stale_kinds(results)
    futures = {executor.submit(work, _subject(group[0])): group for group in kinds}
    count, differing = 0, []
    with progress_bar(len(kinds), "kinds", "kind", progress) as bar:
        for done in as_completed(futures):
            group, again = futures[done], done.result()
            if same(group[0], again):
                for one in group:
                    made = dataclasses.replace(one.provenance, numerics=again.provenance.numerics)
                    put(dataclasses.replace(one, provenance=made))
                count += len(group)
            else:
                differing.append(_subject(group[0]))
            bar.update()
    return Confirmed(count, differing)
