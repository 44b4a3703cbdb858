"""Run many trials on a `concurrent.futures.Executor`; stored ones are not run again.

A trial that was killed goes on from its checkpoint. A trial that fails is reported in
one line, and the others go on. With an executor of other machines, `data` must be a
folder that all of them see.
"""

from __future__ import annotations

import contextlib
import functools
import math
import shutil
import sys
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import NamedTuple

from companion.engine.datasets import collect_motion, refuse_missing_motion
from companion.engine.execute import run_trial
from companion.engine.known_motion import refuse_other_motion
from companion.engine.records import one_line
from companion.engine.rows import Failure, Row
from companion.engine.store import Results
from companion.numerics import version_label
from companion.trials import Trial, motion_of
from sidm.config import ConfigError
from sidm.learning.stopping import CurvePoint
from sidm.pool import as_completed, local_pool
from sidm.progress import Bar, progress_bar

WORKERS = 2  # by default


def checkpoint_folder(data: str | Path, trial: Trial, kind: str = "training") -> Path:
    """The folder of an unfinished trial's state, for today's version of numbers."""
    return Path(data) / "checkpoints" / f"{trial.key}-{version_label(kind)}"


def run(
    trials: Iterable[Trial],
    executor: Executor | None = None,
    workers: int = WORKERS,
    data: str | Path = "data",
    results: Results | str | Path = "results",
    progress: bool = True,
    device: str = "cpu",
    bundle: int = 0,
    seconds: float = math.inf,
) -> Results:
    """Run the trials that are missing, and store each as soon as it is done.

    A row of older versions of the numbers is made again, and replaced. Trials that
    failed are reported on stderr and are still `missing` in the store that is returned;
    trials whose training failed with the current code are not run again.

    Args:
        trials: in the order in which they are started; each is run once.
        executor: where they run, e.g. `distributed.Client(...).get_executor()`; it is
            left open. By default `workers` local processes of one thread each.
        workers: number of local processes; with 1, or with a single trial, this process
            runs the trials.
        data: the folder of the shards; checkpoints lie there too.
        results: the store, or its folder.
        progress: whether to show a bar with the time left.
        device: where the workers compute, 'cpu' or 'cuda'.
        bundle: how many trials are trained side by side in this process, instead of in
            workers; meant for a GPU. Trials that no bundle can train run afterwards in
            workers.
        seconds: after which a bundle writes its trials' states, and this call ends; the
            next one goes on.

    Raises:
        ConfigError: a trial's motion is not on disk, or arguments do not go together.
        OtherMotion: the motion differs, by more than rounding, from that which the
            stored results were made with.
    """
    store = results if isinstance(results, Results) else Results(results)
    wanted = list({trial.key: trial for trial in trials}.values())
    missing = _not_failed(store, store.missing(wanted))
    refuse_missing_motion(missing, data)
    if workers < 1:
        raise ConfigError(f"workers must be at least 1, not {workers}")
    if bundle < 0:
        raise ConfigError(f"bundle must not be negative; it is {bundle}")
    if bundle and executor:
        raise ConfigError(
            "a bundle trains in this process and cannot be used with an executor; "
            f"bundle is {bundle}"
        )
    if seconds < math.inf and not bundle:
        raise ConfigError(
            "seconds are those of a bundle; trials in workers go on where they were "
            "when they are killed"
        )
    until = time.monotonic() + seconds
    if not missing:
        return store
    data = Path(data).absolute()
    _refuse_other_motion(missing, data, store)
    with progress_bar(len(missing), "trials", "trial", progress) as bar:
        runner = _Runner(store, data, bar, device)
        alone = runner.run_bundles(missing, bundle, until) if bundle else missing
        if time.monotonic() < until:
            own = contextlib.nullcontext(executor) if executor else None
            with own or local_pool(min(workers, len(alone))) as pool:
                runner.run_single(alone, pool)
    return store


def _refuse_other_motion(
    trials: Sequence[Trial], data: str | Path, store: Results
) -> None:
    """Refuse trials whose whole datasets are not those of the store."""
    whole = [
        dataset
        for dataset, which in motion_of(trials).items()
        if len(which) == dataset.count
    ]
    refuse_other_motion(whole, data, store.folder)


def _not_failed(store: Results, trials: list[Trial]) -> list[Trial]:
    """The trials that have not failed with today's code; the others are reported."""
    failed = {failure.trial.key: failure for failure in store.failures(trials)}
    for failure in failed.values():
        message = f"{failure}; not run again unless its line in {store.failed.path}"
        print(f"companion: {message} is deleted", file=sys.stderr)
    return [trial for trial in trials if trial.key not in failed]


class _Runner(NamedTuple):
    """Runs trials and stores each as soon as it is done."""

    store: Results
    data: Path
    bar: Bar
    device: str

    def report(self, message: str) -> None:
        self.bar.write(f"companion: {message}", file=sys.stderr)

    def report_failure(self, trial: Trial, error: Exception) -> None:
        """Report a trial that failed; the others go on."""
        self.report(f"{trial}: {one_line(error)}")
        self.bar.update()

    def store_result(self, row: Row | Failure, folder: Path) -> None:
        """Store a trial's row or failure, and delete the folder of its checkpoint."""
        self.store.put(row)
        if isinstance(row, Failure):
            self.report(str(row))
        self.bar.update()
        shutil.rmtree(folder, ignore_errors=True)

    def run_bundles(self, trials: list[Trial], slots: int, until: float) -> list[Trial]:
        """Train bundle after bundle in this process until the time is up.

        Returns:
            The trials that no bundle can train.
        """
        # here, since without a GPU nothing needs them
        from companion.engine.bundles import bundles, fits, run_bundle

        folder = functools.partial(checkpoint_folder, self.data, kind="bundle")

        def show(trial: Trial, tested: CurvePoint) -> None:
            shown = {"samples": tested.samples, "test_loss": f"{tested.test_loss:.4g}"}
            self.bar.set_postfix(shown, refresh=False)

        for group in bundles(filter(fits, trials)):
            if time.monotonic() >= until:
                break
            for trial, result in run_bundle(
                group, slots, self.data, folder, show, self.device, until
            ):
                try:
                    if isinstance(result, Exception):
                        raise result
                    self.store_result(result, folder(trial))
                except Exception as error:
                    self.report_failure(trial, error)
        return [trial for trial in trials if not fits(trial)]

    def run_single(self, trials: list[Trial], executor: Executor) -> None:
        """Run each trial by itself on the executor."""
        work = functools.partial(run_trial, device=self.device)
        folders = {trial: checkpoint_folder(self.data, trial) for trial in trials}
        futures = {
            executor.submit(work, trial, self.data, folder): trial
            for trial, folder in folders.items()
        }
        lost = 0
        for done in as_completed(futures):
            trial = futures[done]
            try:
                self.store_result(done.result(), folders[trial])
            except BrokenProcessPool:
                lost += 1
            except Exception as error:
                self.report_failure(trial, error)
        if lost:
            self.report(
                f"a worker was killed (out of memory?); {lost} trials not done, "
                "run again to go on"
            )


def collect_and_run(
    trials: Iterable[Trial],
    workers: int = WORKERS,
    data: str | Path = "data",
    results: Results | str | Path = "results",
) -> Results:
    """Collect the motion of missing trials, and run them."""
    store = results if isinstance(results, Results) else Results(results)
    missing = store.missing(trials)
    collect_motion(motion_of(missing), data, workers)
    return run(missing, workers=workers, data=data, results=store)
