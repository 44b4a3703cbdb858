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
from collections.abc import Iterable, Iterator
from concurrent.futures import Executor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from companion.engine.datasets import collect_motion
from companion.engine.execute import run_trial
from companion.engine.known_motion import refuse_motion
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
    refuse_motion(missing, data, store.folder)
    lost = 0
    with progress_bar(len(missing), "trials", "trial", progress) as bar:
        arguments = executor, workers, data, device, bundle, until, bar
        for trial, result in _results(missing, *arguments):
            try:
                if isinstance(result, Exception):
                    raise result
                store.put(result)
                if isinstance(result, Failure):
                    bar.write(f"companion: {result}", file=sys.stderr)
                for kind in ("training", "bundle"):
                    folder = checkpoint_folder(data, trial, kind)
                    shutil.rmtree(folder, ignore_errors=True)
            except BrokenProcessPool:
                lost += 1
                continue
            except Exception as error:  # one failure must not lose the others
                bar.write(f"companion: {trial}: {one_line(error)}", file=sys.stderr)
            bar.update()
    if lost:
        print(
            f"companion: a worker was killed (out of memory?); {lost} trials not done, "
            "run again to go on",
            file=sys.stderr,
        )
    return store


def _results(
    trials: list[Trial],
    executor: Executor | None,
    workers: int,
    data: Path,
    device: str,
    bundle: int,
    until: float,
    bar: Bar,
) -> Iterator[tuple[Trial, Row | Failure | Exception]]:
    """Run trials: in bundles what these can train, then the others by themselves."""
    if bundle:
        # here, since without a GPU nothing needs them
        from companion.engine.bundles import bundles, fits, run_bundle

        folder = functools.partial(checkpoint_folder, data, kind="bundle")

        def show(trial: Trial, tested: CurvePoint) -> None:
            shown = {"samples": tested.samples, "test_loss": f"{tested.test_loss:.4g}"}
            bar.set_postfix(shown, refresh=False)

        for group in bundles(filter(fits, trials)):
            if time.monotonic() < until:
                yield from run_bundle(group, bundle, data, folder, show, device, until)
        trials = [trial for trial in trials if not fits(trial)]
    if time.monotonic() < until:
        own = contextlib.nullcontext(executor) if executor else None
        with own or local_pool(min(workers, len(trials))) as pool:
            futures = {}
            for trial in trials:
                where = data, checkpoint_folder(data, trial)
                futures[pool.submit(run_trial, trial, *where, device=device)] = trial
            for done in as_completed(futures):
                result: Row | Failure | Exception
                try:
                    result = done.result()
                except Exception as error:
                    result = error
                yield futures[done], result


def _not_failed(store: Results, trials: list[Trial]) -> list[Trial]:
    """The trials that have not failed with today's code; the others are reported."""
    failed = {failure.trial.key: failure for failure in store.failures(trials)}
    for failure in failed.values():
        message = f"{failure}; not run again unless its line in {store.failed.path}"
        print(f"companion: {message} is deleted", file=sys.stderr)
    return [trial for trial in trials if trial.key not in failed]


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
