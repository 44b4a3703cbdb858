"""Run many trials on any `concurrent.futures.Executor`; what is stored is not run again.

A trial that is killed goes on from its checkpoint, a trial that fails is reported in one line and the others go on.
With an executor of other machines, `data` must be a folder that they all see.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from sidm.config import ConfigError
from sidm.experiments.engine.bundles import Hooks, bundles, fits, run_bundle
from sidm.experiments.engine.datasets import note_datasets, others
from sidm.experiments.engine.event_log import EventLog
from sidm.experiments.engine.execute import run_trial
from sidm.experiments.engine.store import Failure, Results, Row, StoreError
from sidm.experiments.trials import UNKNOWN, Trial
from sidm.learning.training import Tested, TrainingError
from sidm.numerics import numbered
from sidm.pool import local_pool
from sidm.progress import Bar, progress_bar
from sidm.storage import sweep

WORKERS = 2  # by default


def checkpoint_folder(data: str | Path, trial: Trial, kind: str = "training") -> Path:
    """Where an unfinished trial keeps its state: apart for each version of the numbers, so that none are mixed."""
    return Path(data) / "checkpoints" / f"{trial.key}-{numbered(kind)}"


def refuse_unknown_data(trials: Iterable[Trial]) -> None:
    """ConfigError naming the first dataset whose digest is not known, and the command that makes it."""
    for trial in trials:
        for kind, dataset in trial.datasets.items():
            if trial.digests[kind] == UNKNOWN:
                raise ConfigError(
                    f"the dataset {dataset.name} is neither on this disk nor known to the results; "
                    f"'sidm collect --preset NAME --system {trial.system}' makes a preset's data"
                )


def run(
    trials: Iterable[Trial],
    executor: Executor | None = None,
    workers: int = WORKERS,
    data: str | Path = "data",
    results: Results | str | Path = "results",
    progress: bool = True,
    device: str = "cpu",
    bundle: int = 0,
    log: str | Path | None = None,
) -> Results:
    """Run the trials that are not stored, and store each as soon as it is done.

    Args:
        trials: in the order in which they are started; each is run once.
        executor: where they run, e.g. `distributed.Client(...).get_executor()`; it is left open. By default `workers`
            local processes of one thread each.
        workers: number of local processes; for one of them, or a single trial, this process does.
        data: the folder of the shards; checkpoints lie there too.
        results: the store, or its folder.
        progress: whether to show a bar with the time left.
        device: where the workers compute, 'cpu' or 'cuda'.
        bundle: how many trials are trained side by side in this process, instead of in workers; what a GPU is for.
            Those that no bundle can train follow in workers.
        log: a folder for TensorBoard's event files.

    Returns:
        The store. Trials that failed are reported on stderr and are still `missing` there; those whose training this
        code has seen fail are not run again.

    Raises:
        ConfigError: the digest of a trial's data is unknown, `workers` is below 1, `bundle` below 0, or a bundle meant
            for an executor.
        ImportError: TensorBoard is asked for and not installed; one line.
    """
    store = results if isinstance(results, Results) else Results(results)
    wanted = list({trial.key: trial for trial in trials}.values())
    missing = _not_failed(store, store.missing(wanted))
    refuse_unknown_data(missing)
    if workers < 1:
        raise ConfigError(f"workers must be at least 1, not {workers}")
    if bundle < 0 or (bundle and executor):
        raise ConfigError(f"bundle must not be negative, nor go with an executor; it is {bundle}")
    sweep(store.folder / "trials")
    EventLog(log)  # a missing TensorBoard is known before hours of work
    if missing:
        data = Path(data).absolute()
        note_datasets(missing, data, store.folder)
        with progress_bar(len(missing), "trials", "trial", progress) as bar:
            together = [trial for trial in missing if bundle and fits(trial)]
            alone = [trial for trial in missing if not (bundle and fits(trial))]
            if together:
                _run_bundles(together, bundle, data, store, bar, device, log)
            if alone:
                places = min(workers, len(alone))
                here = contextlib.nullcontext(executor)
                with here if executor or places == 1 else local_pool(places) as where:
                    _run_all(alone, where, data, store, bar, device, log)
    return store


def _not_failed(store: Results, trials: list[Trial]) -> list[Trial]:
    """Those that today's code has not seen fail; the others are reported."""
    failed = {failure.trial.key: failure for failure in store.failures(trials)}
    for failure in failed.values():
        print(f"sidm: {failure}; not run again unless {store.failure_path(failure.trial)} is deleted", file=sys.stderr)
    return [trial for trial in trials if trial.key not in failed]


def _run_bundles(
    trials: list[Trial], seats: int, data: Path, store: Results, bar: Bar, device: str, log: str | Path | None
) -> None:
    """Train bundle after bundle in this process and store each trial as it ends."""
    with EventLog(log) as events:

        def show(trial: Trial, tested: Tested) -> None:
            events.progress(trial)(tested)
            bar.set_postfix(samples=tested.samples, test_loss=f"{tested.test_loss:.4g}", refresh=False)

        def fault(trial: Trial, error: Exception) -> None:
            _report(bar, f"{trial}: {one_line(error)}")
            bar.update()

        for group in bundles(trials):
            folder = functools.partial(checkpoint_folder, data, kind="bundle")
            for row in run_bundle(group, seats, data, folder, Hooks(show, fault), device):
                try:
                    _keep(row, store, data, bar)
                except StoreError as error:
                    fault(row.trial, error)
                else:
                    shutil.rmtree(folder(row.trial), ignore_errors=True)


def of_data(row: Row | Failure, data: str | Path) -> Row | Failure:
    """The row with a word of data that only stand for the trial's own."""
    found = others(row.trial, data)
    made = dataclasses.replace(row.provenance, other_data=found)  # type: ignore[type-var]
    return dataclasses.replace(row, provenance=made) if found else row  # type: ignore[type-var]


def _keep(row: Row | Failure, store: Results, data: str | Path, bar: Bar) -> None:
    """Store what became of a trial, and whether its data were made again elsewhere."""
    store.put(of_data(row, data))
    if isinstance(row, Failure):
        _report(bar, str(row))
    bar.update()


Outcome = Callable[[], Row | Failure]  # what became of a trial, or the error that it raised


def _outcomes(
    trials: list[Trial], executor: Executor | None, data: Path, device: str, log: str | Path | None
) -> Iterator[tuple[Trial, Outcome]]:
    """Every trial with its outcome: in this process one after the other, with an executor as they end."""
    run_on = functools.partial(run_trial, device=device, log=log)
    if executor is None:
        for trial in trials:
            yield trial, functools.partial(run_on, trial, data, checkpoint_folder(data, trial))
    else:
        futures = {executor.submit(run_on, trial, data, checkpoint_folder(data, trial)): trial for trial in trials}
        for done in as_completed(futures):
            yield futures[done], done.result


def _run_all(
    trials: list[Trial], executor: Executor | None, data: Path, store: Results, bar: Bar, device: str,
    log: str | Path | None,
) -> None:  # fmt: skip
    """Store each trial as its outcome comes."""
    lost = 0
    for trial, outcome in _outcomes(trials, executor, data, device, log):
        try:
            _keep(outcome(), store, data, bar)
        except BrokenProcessPool:
            lost += 1
        except Exception as error:  # one trial's failure must not lose the others
            _report(bar, f"{trial}: {one_line(error)}")
            bar.update()
        else:
            shutil.rmtree(checkpoint_folder(data, trial), ignore_errors=True)
    if lost:
        _report(bar, f"a worker was killed (out of memory?); {lost} trials not done, run again to go on")


def one_line(error: BaseException) -> str:
    """An error for a person: the first line of its message, after its type where that says more."""
    text = (str(error).splitlines() or [""])[0]
    plain = isinstance(error, (ValueError, OSError, ImportError)) and text
    return text if plain else f"{type(error).__name__}: {text}".rstrip(": ")


def _report(bar: Bar, message: str) -> None:
    bar.write(f"sidm: {message}", file=sys.stderr)


def run_here(
    trial: Trial,
    data: str | Path = "data",
    results: Results | str | Path = "results",
    progress: bool = True,
    device: str = "cpu",
    log: str | Path | None = None,
) -> Row:
    """Run one trial in this process unless it is stored, and store it; errors are raised.

    The bar counts samples up to `max_samples`, which early stopping seldom lets a trial reach.

    Raises:
        ShardError: data are missing or others than the trial's.
        TrainingError: a loss was not finite; the failure is stored.
    """
    store = results if isinstance(results, Results) else Results(results)
    stored = store.get(trial)
    if stored is not None:
        return stored
    refuse_unknown_data([trial])
    note_datasets([trial], data, store.folder)
    with progress_bar(trial.training.max_samples, str(trial), "sample", progress, scaled=True) as bar:

        def show(tested: Tested) -> None:
            bar.set_postfix(test_loss=f"{tested.test_loss:.4g}", refresh=False)
            bar.update(tested.samples - bar.n)

        row = run_trial(trial, data, checkpoint_folder(data, trial), show, device, log)
    row = of_data(row, data)
    store.put(row)
    shutil.rmtree(checkpoint_folder(data, trial), ignore_errors=True)
    if isinstance(row, Failure):
        raise TrainingError(row.what, float(row.loss), row.iteration)
    return row
