"""Parallel runs of notebooks, each with its own kernel.

The first notebook that fails stops all others.
"""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from sidm.progress import progress_bar

#: Run time of the longest notebooks, s, roughly. They start first; the progress bar
#: computes the time left from it.
SECONDS = {
    "03-method": 55,
    "20-own-data": 35,
    "02-collecting": 15,
    "17-suspension": 15,
    "01-robots": 10,
    "13-driving": 8,
    "04-figure3": 6,
}
OTHER_SECONDS = 4  # run time of any other notebook, s
#: Without it the kernel would warn that it listens on local ports.
KERNEL_ARGUMENTS = ["--log-level=ERROR"]
START_ATTEMPTS = 3  # to start a kernel
OUTPUT_TIMEOUT = 60  # s after the end of a cell, for its outputs to arrive


class NotebookError(RuntimeError):
    """A notebook failed; the message is one line with the cell and its error."""


class Run(NamedTuple):
    """One notebook to execute."""

    path: Path
    #: path of the executed copy; None to refresh the notebook itself
    output: Path | None = None
    values: Mapping[str, Any] = {}  # checked parameters

    @property
    def seconds(self) -> int:
        """The approximate run time, s."""
        return SECONDS.get(self.path.stem, OTHER_SECONDS)


def cores() -> int:
    """The number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def execute(runs: Sequence[Run], root: Path, jobs: int | None = None) -> None:
    """Execute notebooks in parallel.

    Several notebooks have a progress bar with the time left; a single one has it on a
    terminal only. When a notebook fails, its copy keeps the outputs up to the error; a
    notebook that was to be refreshed stays as it was.

    Args:
        runs: the notebooks; the longest start first.
        root: the project's folder, which is the kernels' working folder.
        jobs: number of kernels at a time; by default the number of cores. Several
            kernels have one thread each.

    Raises:
        NotebookError: a cell failed. All kernels have ended.
    """
    jobs = min(jobs or cores(), len(runs))
    shown = len(runs) > 1 or sys.stderr.isatty()
    with progress_bar(100, "notebooks", "%", shown) as bar:
        total, done = sum(run.seconds for run in runs), 0.0

        def advance(seconds: float) -> None:
            nonlocal done
            done += seconds
            bar.update(round(100 * done / total) - bar.n)

        def report(run: Run) -> None:
            bar.write(str(run.output or run.path), file=sys.stdout)

        asyncio.run(_execute_queues(_queues(runs), root, jobs, advance, report))


def _queues(runs: Sequence[Run]) -> list[list[Run]]:
    """Queues of runs: the runs of a queue are executed one after the other.

    Notebooks that run missing trials share the first queue, because they use each
    other's trials. Each other notebook has its own queue, the longest first.
    """
    dependent = [run for run in runs if run.values.get("run_missing")]
    independent = [run for run in runs if run not in dependent]
    independent.sort(key=lambda run: -run.seconds)
    return [dependent] * bool(dependent) + [[run] for run in independent]


async def _execute_queues(
    queues: Iterable[list[Run]],
    root: Path,
    jobs: int,
    advance: Callable[[float], None],
    report: Callable[[Run], None],
) -> None:
    """Execute `jobs` queues at a time; an error or an interruption ends all of them.

    Args:
        queues: the queues; the first ones start first.
        root: the kernels' working folder.
        jobs: number of kernels at a time.
        advance: called with the share of a run's seconds after each cell.
        report: called after each run.
    """
    free = asyncio.Semaphore(jobs)
    environment = {**({"OMP_NUM_THREADS": "1"} if jobs > 1 else {}), **os.environ}

    async def execute_queue(queue: list[Run]) -> None:
        async with free:
            for run in queue:
                await _execute(run, root, environment, advance)
                report(run)

    tasks = [asyncio.create_task(execute_queue(queue)) for queue in queues]
    try:
        for finished in asyncio.as_completed(tasks):
            await finished
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _execute(
    run: Run,
    root: Path,
    environment: Mapping[str, str],
    advance: Callable[[float], None],
) -> None:
    """Execute one notebook; its kernel ends in any case."""
    from nbclient import NotebookClient
    from nbclient.exceptions import CellControlSignal
    from nbclient.util import ensure_async

    notebook, complete = _load(run), False
    client = NotebookClient(
        notebook,
        timeout=None,
        iopub_timeout=OUTPUT_TIMEOUT,
        raise_on_iopub_timeout=True,
        record_timing=False,
        resources={"metadata": {"path": str(root)}},
        extra_arguments=list(KERNEL_ARGUMENTS),
    )
    client.reset_execution_trackers()
    try:
        await _start(client, environment)
        for index, cell in enumerate(notebook.cells):
            await client.async_execute_cell(
                cell, index, execution_count=client.code_cells_executed + 1
            )
            advance(run.seconds / len(notebook.cells))
        client.set_widgets_metadata()
        complete = True
    except (CellControlSignal, RuntimeError) as error:
        reason = _reason(error, client.code_cells_executed)
        kept = _keep_partial(run, notebook)
        raise NotebookError(f"{run.path}: {reason}; {kept}") from None
    finally:
        if client.kc is not None:
            client.kc.stop_channels()
        if client.km is not None:
            await ensure_async(client.km.shutdown_kernel(now=not complete))
    _write(run, notebook)


async def _start(client: Any, environment: Mapping[str, str]) -> None:
    """Start a kernel and connect to it.

    A start fails when another process takes a port that was free a moment before; then
    it is tried again.
    """
    from nbclient.util import ensure_async

    for attempts_left in reversed(range(START_ATTEMPTS)):
        kernel = client.create_kernel_manager()
        try:
            await client.async_start_new_kernel(env=dict(environment))
            await client.async_start_new_kernel_client()
            return
        except RuntimeError:
            await ensure_async(kernel.shutdown_kernel(now=True))
            if not attempts_left:
                raise


def _load(run: Run) -> Any:
    """Read the notebook and set its parameters."""
    import nbformat

    if not run.values:
        return nbformat.read(run.path, as_version=4)
    from papermill.iorw import load_notebook_node
    from papermill.parameterize import parameterize_notebook

    return parameterize_notebook(load_notebook_node(str(run.path)), dict(run.values))


def _reason(error: Exception, cell: int) -> str:
    """One line with the execution number of the failed cell and its error."""
    from nbclient.exceptions import DeadKernelError

    if isinstance(error, DeadKernelError):
        return f"cell {cell} failed, its kernel died (out of memory?)"
    name = getattr(error, "ename", type(error).__name__)
    text = str(getattr(error, "evalue", error))
    where = f"cell {cell} failed" if cell else "its kernel did not start"
    return f"{where}, {name}: {(text.splitlines() or [''])[0]}"


def _keep_partial(run: Run, notebook: Any) -> str:
    """Write the copy of a notebook that failed; returns text that says where it is."""
    if run.output is None:
        return "the notebook is unchanged"
    _write(run, notebook)
    return f"the run up to there is {run.output}"


def _write(run: Run, notebook: Any) -> None:
    """Write the executed copy, or refresh the notebook itself."""
    import nbformat

    if run.output is None:
        _remove_changing_parts(notebook)
    target = run.output or run.path
    target.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(notebook, target)


def _remove_changing_parts(notebook: Any) -> None:
    """Remove what differs in each run: papermill's metadata and live widgets.

    The static output beside a widget stays.
    """
    for part in (notebook, *notebook.cells):
        part.metadata.pop("papermill", None)
    notebook.metadata.pop("widgets", None)
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            output.get("data", {}).pop("application/vnd.jupyter.widget-view+json", None)
