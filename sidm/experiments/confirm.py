"""Stored rows that older code made and that today's code would make again: confirmed by a sample instead of hours.

Of every kind of stale trial the quickest is run again. The trials of a kind are equal but for size, seed, and how large
those numbers of their trainings are that are not zero. Where the quickest comes out as it is stored, to the last stored
digit, all rows of its kind count as made by today's code, and say so. Diagnoses and the records of the other studies go
the same way, their measured times apart.
"""

from __future__ import annotations

import dataclasses
import functools
import json
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from sidm.experiments.provenance import Provenance, source_hash
from sidm.experiments.solved import run_trial
from sidm.experiments.store import Failure, Results, Row, rounded
from sidm.experiments.trials import Trial
from sidm.progress import progress_bar

if TYPE_CHECKING:
    from sidm.experiments.records import Records


class Confirmed(NamedTuple):
    """What came of it."""

    confirmed: int  # results that now count as today's
    differing: list[Any]  # what they are of that were made again and came out otherwise; their kinds stay stale


def candidates(trials: Iterable[Trial], store: Results) -> list[list[Row]]:
    """Stale rows by kind, the quickest first: not of bundles, and made from data that today's code would make."""
    return _by_kind(store.rows(trials))


def _by_kind(found: Iterable[Any]) -> list[list[Any]]:
    """As `candidates`, of rows, diagnoses or records; those of different older code are different kinds."""
    kinds: dict[tuple, list[Any]] = {}
    for one in found:
        made = one.provenance
        if one.stale and not made.bundle and made.simulation_source == source_hash("simulation"):
            source = getattr(one, "source", "")  # of a diagnosis' or record's own code; a row has none
            kinds.setdefault((kind(_subject(one)), made.learning_source, source), []).append(one)
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


def same(row: Row, again: Row | Failure) -> bool:
    """Whether two rows have the same outcome to the digits that are stored."""
    if isinstance(again, Failure):
        return False
    stored, found = (rounded(dataclasses.asdict(one.outcome)) for one in (row, again))  # type: ignore[call-overload]
    return stored == found


def confirm(
    trials: Iterable[Trial], store: Results, executor: Executor, data: str | Path = "data", progress: bool = True
) -> Confirmed:
    """Run one of each kind of stale row again, and mark the kinds that come out the same.

    Rows that lie under the keys of older code move to today's first.

    Args:
        trials: whose rows are looked at.
        store: where they are.
        executor: where the trials run; on another machine or PyTorch they seldom come out the same to the last digit.
        data: the folder of the shards.
        progress: whether to show a bar.
    """

    def mark(row: Row, again: Row, how: str) -> None:
        store.put(dataclasses.replace(row, provenance=_confirmed(row, again, how)))

    store.rekey()
    work = functools.partial(run_trial, data=Path(data).absolute())
    return _confirm(candidates(trials, store), executor, work, same, mark, progress)


def confirm_diagnoses(
    trials: Iterable[Trial], results: Path, executor: Executor, data: str | Path = "data", progress: bool = True
) -> Confirmed:
    """The same for the stored diagnoses of `trials` under `results`."""
    from sidm.experiments import diagnostics  # scikit-learn need not be there to confirm rows

    def mark(one: diagnostics.Diagnosis, again: diagnostics.Diagnosis, how: str) -> None:
        diagnostics.write(_marked(one, again, how), results)

    stored = [found for found in (diagnostics.read(trial, results) for trial in trials) if found is not None]
    work = functools.partial(diagnostics.diagnose, data=Path(data).absolute())
    return _confirm(_by_kind(stored), executor, work, _alike(), mark, progress)


def confirm_records(
    abouts: Iterable[Any],
    records: Records,
    work: Callable[[Any], Any],
    executor: Executor,
    times: Sequence[str] = (),
    progress: bool = True,
) -> Confirmed:
    """The same for the records of a study: `work` makes one again, `times` are its fields that are measured times."""

    def mark(one: Any, again: Any, how: str) -> None:
        records.put(_marked(one, again, how))

    return _confirm(_by_kind(records.stored(abouts)), executor, work, _alike(times), mark, progress)


_MADE = ("source", "scikit_learn", "provenance")  # what made a diagnosis or a record, and is no part of what was found


def _alike(times: Sequence[str] = ()) -> Callable[[Any, Any], bool]:
    """Whether two diagnoses or records found the same, to the digits that are stored."""

    def alike(one: Any, again: Any) -> bool:
        plain = (dataclasses.asdict(each) for each in (one, again))
        stored, found = ({k: rounded(v) for k, v in each.items() if k not in (*_MADE, *times)} for each in plain)
        return stored == found

    return alike


def _confirm(
    kinds: list[list[Any]],
    executor: Executor,
    work: Callable[[Any], Any],
    alike: Callable[[Any, Any], bool],
    mark: Callable[[Any, Any, str], None],
    progress: bool,
) -> Confirmed:
    """Make the first of each kind again; where it is `alike`, `mark` all of the kind."""
    futures = {executor.submit(work, _subject(group[0])): group for group in kinds}
    count, differing = 0, []
    with progress_bar(len(kinds), "kinds", "kind", progress) as bar:
        for done in as_completed(futures):
            group, again = futures[done], done.result()
            if alike(group[0], again):
                for number, one in enumerate(group):
                    mark(one, again, "sample" if number else "rerun")
                count += len(group)
            else:
                differing.append(_subject(group[0]))
            bar.update()
    return Confirmed(count, differing)


def _marked(one: Any, again: Any, how: str) -> Any:
    """A diagnosis or record as later code's."""
    return dataclasses.replace(one, source=again.source, provenance=_confirmed(one, again, how))


def _confirmed(one: Any, again: Any, how: str) -> Provenance:
    """The provenance of a result that later code makes again."""
    made = again.provenance.learning_source
    return dataclasses.replace(one.provenance, confirmed_source=made, confirmed_by=how)
