"""Notebooks executed side by side, each on a kernel of its own; the first that fails stops the others."""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from sidm.progress import progress_bar

#: About how long the longest notebooks take, s: they begin first, and the time left is
#: told by it.
SECONDS = {
    "04-training": 50,
    "21-own-data": 35,
    "02-collecting": 15,
    "18-suspension": 15,
    "01-robots": 10,
    "12-driving": 8,
    "05-figure3": 6,
}
OTHERS = 4  # s that any other takes
#: of the kernel, which would warn that it listens on this machine's own ports
QUIET = ["--log-level=ERROR"]
STARTS = 3  # tries at a kernel
LATEST = 60  # s after a cell's end until its outputs must be there


class NotebookError(RuntimeError):
    """A notebook that could not be run to its end; the message is one line naming the cell and its error."""


class Run(NamedTuple):
    """One notebook to be executed."""

    path: Path
    #: where the executed copy goes; None refreshes the notebook itself
    output: Path | None = None
    values: Mapping[str, Any] = {}  # its parameters, checked

    @property
    def seconds(self) -> int:
        """About how long it takes."""
        return SECONDS.get(self.path.stem, OTHERS)


def cores() -> int:
    """How many processors this process may use."""
    return (
        len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count() or 1
    )


def execute(runs: Sequence[Run], root: Path, jobs: int | None = None) -> None:
    """Execute notebooks side by side; of several, or on a terminal, with a bar that has the time left.

    A notebook that was to be refreshed and did not come to its end is as it was; a copy
    holds all up to where it came.

    Args:
        runs: what to execute; the longest begin first.
        root: the project's folder, in which they work.
        jobs: how many kernels at a time, of one thread each where they are several; all
            cores when None.

    Raises:
        NotebookError: a cell failed; no kernel runs any more.
    """
    places = min(jobs or cores(), len(runs))
    with progress_bar(
        100, "notebooks", "%", len(runs) > 1 or sys.stderr.isatty()
    ) as bar:
        total, done = sum(run.seconds for run in runs), 0.0

        def more(seconds: float) -> None:
            nonlocal done
            done += seconds
            bar.update(round(100 * done / total) - bar.n)

        def tell(run: Run) -> None:
            bar.write(str(run.output or run.path), file=sys.stdout)

        asyncio.run(_side_by_side(_lanes(runs), root, places, more, tell))


def _lanes(runs: Sequence[Run]) -> list[list[Run]]:
    """What must be done in turn, the longest first: notebooks that run what is missing take trials from one another."""
    together = [run for run in runs if run.values.get("run_missing")]
    alone = sorted(
        (run for run in runs if run not in together), key=lambda run: -run.seconds
    )
    return [together] * bool(together) + [[run] for run in alone]


async def _side_by_side(
    lanes: Iterable[list[Run]],
    root: Path,
    places: int,
    more: Callable[[float], None],
    tell: Callable[[Run], None],
) -> None:
    """Execute so many lanes at a time; whatever ends this early ends all of them."""
    free = asyncio.Semaphore(places)
    environment = {**({"OMP_NUM_THREADS": "1"} if places > 1 else {}), **os.environ}

    async def follow(lane: list[Run]) -> None:
        async with free:
            for run in lane:
                await _execute(run, root, environment, more)
                tell(run)

    tasks = [asyncio.create_task(follow(lane)) for lane in lanes]
    try:
        for task in asyncio.as_completed(tasks):
            await task
    finally:
        for one in tasks:
            one.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _execute(
    run: Run, root: Path, environment: Mapping[str, str], more: Callable[[float], None]
) -> None:
    """Execute one notebook; its kernel has ended when this does, in whatever way."""
    from nbclient import NotebookClient
    from nbclient.exceptions import CellControlSignal
    from nbclient.util import ensure_async

    notebook, ended = _load(run), False
    client = NotebookClient(
        notebook,
        timeout=None,
        iopub_timeout=LATEST,
        raise_on_iopub_timeout=True,
        record_timing=False,
        resources={"metadata": {"path": str(root)}},
        extra_arguments=list(QUIET),
    )
    client.reset_execution_trackers()
    try:
        await _start(client, environment)
        for index, cell in enumerate(notebook.cells):
            await client.async_execute_cell(
                cell, index, execution_count=client.code_cells_executed + 1
            )
            more(run.seconds / len(notebook.cells))
        client.set_widgets_metadata()
        ended = True
    except (CellControlSignal, RuntimeError) as error:
        reason = _reason(error, client.code_cells_executed)
        raise NotebookError(f"{run.path}: {reason}; {_kept(run, notebook)}") from None
    finally:
        if client.kc is not None:
            client.kc.stop_channels()
        if client.km is not None:
            await ensure_async(client.km.shutdown_kernel(now=not ended))
    _write(run, notebook)


async def _start(client: Any, environment: Mapping[str, str]) -> None:
    """Start a kernel that answers; once more where another process was quicker to take a port that was free."""
    from nbclient.util import ensure_async

    for left in reversed(range(STARTS)):
        kernel = client.create_kernel_manager()
        try:
            await client.async_start_new_kernel(env=dict(environment))
            await client.async_start_new_kernel_client()
            return
        except RuntimeError:
            await ensure_async(kernel.shutdown_kernel(now=True))
            if not left:
                raise


def _load(run: Run) -> Any:
    """The notebook with its parameters in place."""
    import nbformat

    if not run.values:
        return nbformat.read(run.path, as_version=4)
    from papermill.iorw import load_notebook_node
    from papermill.parameterize import parameterize_notebook

    return parameterize_notebook(load_notebook_node(str(run.path)), dict(run.values))


def _reason(error: Exception, cell: int) -> str:
    """Which cell, by the number that stands beside it, and what it said; in one line."""
    from nbclient.exceptions import DeadKernelError

    if isinstance(error, DeadKernelError):
        return f"cell {cell} failed, its kernel died (out of memory?)"
    name, text = (
        getattr(error, "ename", type(error).__name__),
        str(getattr(error, "evalue", error)),
    )
    where = f"cell {cell} failed" if cell else "its kernel did not start"
    return f"{where}, {name}: {(text.splitlines() or [''])[0]}"


def _kept(run: Run, notebook: Any) -> str:
    """Keep what a notebook that failed came to, and say where."""
    if run.output is None:
        return "the notebook is unchanged"
    _write(run, notebook)
    return f"the run up to there is {run.output}"


def _write(run: Run, notebook: Any) -> None:
    """Write the copy, or refresh the notebook."""
    import nbformat

    if run.output is None:
        _still(notebook)
    target = run.output or run.path
    target.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(notebook, target)


def _still(notebook: Any) -> None:
    """Leave out what is another at each run: papermill's notes, and of live widgets all but what stands in for them."""
    for part in (notebook, *notebook.cells):
        part.metadata.pop("papermill", None)
    notebook.metadata.pop("widgets", None)
    for output in (
        output for cell in notebook.cells for output in cell.get("outputs", [])
    ):
        output.get("data", {}).pop("application/vnd.jupyter.widget-view+json", None)
