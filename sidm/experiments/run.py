"""Run many trials on any `concurrent.futures.Executor`; what is stored is not run again.

A trial that is killed goes on from its checkpoint, a trial that fails is reported in one line and the others go on.
With an executor of other machines, `data` must be a folder that they all see.
"""

from __future__ import annotations

import contextlib
import shutil
import sys
from collections.abc import Iterable
from concurrent.futures import Executor, Future, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from tqdm import tqdm

from sidm.config import ConfigError
from sidm.experiments.datasets import note_datasets
from sidm.experiments.measure import run_trial
from sidm.experiments.pool import local_pool
from sidm.experiments.provenance import source_hash
from sidm.experiments.store import Results, Row
from sidm.experiments.trials import UNKNOWN, Trial
from sidm.learning.training import Tested

WORKERS = 2  # by default


def checkpoint_folder(data: str | Path, trial: Trial) -> Path:
    """Where an unfinished trial keeps its state: apart for each version of the code, so that none are mixed."""
    return Path(data) / "checkpoints" / f"{trial.key}-{source_hash('learning')}"


def refuse_unknown_data(trials: Iterable[Trial]) -> None:
    """ConfigError naming the first dataset whose digest is not known, and the command that makes it."""
    for trial in trials:
        for kind, dataset in trial.datasets.items():
            if trial.digests[kind] == UNKNOWN:
                raise ConfigError(
                    f"the dataset {dataset.name} is neither on this disk nor known to the results; "
                    f"'python -m sidm collect --preset NAME --system {trial.system}' makes a preset's data"
                )


def run(
    trials: Iterable[Trial],
    executor: Executor | None = None,
    workers: int = WORKERS,
    data: str | Path = "data",
    results: Results | str | Path = "results",
    progress: bool = True,
    device: str = "cpu",
) -> Results:
    """Run the trials that are not stored, and store each as soon as it is done.

    Args:
        trials: in the order in which they are started; each is run once.
        executor: where they run, e.g. `distributed.Client(...).get_executor()`; it is left open. By default `workers`
            local processes of one thread each.
        workers: number of local processes.
        data: the folder of the shards; checkpoints lie there too.
        results: the store, or its folder.
        progress: whether to show a bar with the time left.
        device: where the workers compute, 'cpu' or 'cuda'.

    Returns:
        The store. Trials that failed are reported on stderr and are still `missing` there.

    Raises:
        ConfigError: the digest of a trial's data is unknown, or `workers` is below 1.
    """
    store = results if isinstance(results, Results) else Results(results)
    wanted = list({trial.key: trial for trial in trials}.values())
    missing = store.missing(wanted)
    refuse_unknown_data(missing)
    if workers < 1:
        raise ConfigError(f"workers must be at least 1, not {workers}")
    if missing:
        note_datasets(missing, store.folder)
        pool = contextlib.nullcontext(executor) if executor else local_pool(min(workers, len(missing)))
        with pool as where:
            _run_all(missing, where, Path(data).absolute(), store, progress, device)
    return store


def _run_all(trials: list[Trial], executor: Executor, data: Path, store: Results, progress: bool, device: str) -> None:
    """Submit every trial and store each as it comes back."""
    futures: dict[Future[Row], Trial] = {
        executor.submit(run_trial, trial, data, checkpoint_folder(data, trial), None, device): trial for trial in trials
    }
    with tqdm(total=len(futures), desc="trials", unit="trial", disable=not progress) as bar:
        lost = 0
        for done in as_completed(futures):
            trial = futures[done]
            try:
                store.put(done.result())
            except BrokenProcessPool:
                lost += 1
                continue
            except Exception as error:  # one trial's failure must not lose the others
                _report(bar, f"{trial}: {one_line(error)}")
            else:
                shutil.rmtree(checkpoint_folder(data, trial), ignore_errors=True)
            bar.update()
        if lost:
            _report(bar, f"a worker was killed (out of memory?); {lost} trials not done, run again to go on")


def one_line(error: BaseException) -> str:
    """An error for a person: the first line of its message, after its type where that says more."""
    text = (str(error).splitlines() or [""])[0]
    plain = isinstance(error, (ValueError, OSError, ImportError)) and text
    return text if plain else f"{type(error).__name__}: {text}".rstrip(": ")


def _report(bar: tqdm, message: str) -> None:
    bar.write(f"sidm: {message}", file=sys.stderr)


def run_here(
    trial: Trial,
    data: str | Path = "data",
    results: Results | str | Path = "results",
    progress: bool = True,
    device: str = "cpu",
) -> Row:
    """Run one trial in this process unless it is stored, and store it; errors are raised.

    The bar counts samples up to `max_samples`, which early stopping seldom lets a trial reach.
    """
    store = results if isinstance(results, Results) else Results(results)
    stored = store.get(trial)
    if stored is not None:
        return stored
    refuse_unknown_data([trial])
    note_datasets([trial], store.folder)
    total = trial.training.max_samples
    with tqdm(total=total, desc=str(trial), unit="sample", unit_scale=True, disable=not progress) as bar:

        def show(tested: Tested) -> None:
            bar.set_postfix(test_loss=f"{tested.test_loss:.4g}", refresh=False)
            bar.update(tested.samples - bar.n)

        row = run_trial(trial, data, checkpoint_folder(data, trial), show, device)
    store.put(row)
    shutil.rmtree(checkpoint_folder(data, trial), ignore_errors=True)
    return row
