"""Runs of notebooks by papermill, several side by side, each with its own kernel."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from sidm.pool import as_completed, local_pool
from sidm.progress import progress_bar

#: Without it the kernel would warn that it listens on local ports.
KERNEL_ARGUMENTS = ["--log-level=ERROR"]
START_ATTEMPTS = 3  # to start a kernel: another one may take its port
OUTPUT_TIMEOUT = 60  # s after the end of a cell, for its outputs to arrive


class NotebookError(RuntimeError):
    """A notebook failed; the message is one line with the cell and its error."""


class Run(NamedTuple):
    """One notebook to execute."""

    path: Path
    #: path of the executed copy; None to refresh the notebook itself
    output: Path | None = None
    values: Mapping[str, Any] = {}  # checked parameters


def cores() -> int:
    """The number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def execute(runs: Sequence[Run], root: Path, jobs: int | None = None) -> None:
    """Execute notebooks in parallel, in the project's folder `root`.

    Notebooks that run missing trials run one after the other, because they use each
    other's trials. When a notebook fails, its copy keeps the outputs up to the error; a
    notebook that was to be refreshed stays as it was; the other kernels end, and
    NotebookError is raised. `jobs` is the number of kernels at a time, of one thread
    each if there are several; by default the number of cores.
    """
    dependent = [run for run in runs if run.values.get("run_missing")]
    queues = [[run] for run in runs if run not in dependent]
    queues = [dependent] * bool(dependent) + queues
    jobs = min(jobs or cores(), len(queues))
    several = len(runs) > 1
    with (
        progress_bar(len(runs), "notebooks", "notebook", several) as bar,
        local_pool(jobs) as pool,
    ):
        work = (root.resolve(), jobs > 1, not several and sys.stderr.isatty())
        futures = [pool.submit(_execute, queue, *work) for queue in queues]
        for done in as_completed(futures):
            for path in done.result():
                bar.write(str(path), file=sys.stdout)
                bar.update()


def _execute(
    queue: Sequence[Run], root: Path, one_thread: bool, progress: bool
) -> list[Path]:
    """Execute notebooks one after the other; returns what was written."""
    if one_thread:
        os.environ.setdefault("OMP_NUM_THREADS", "1")  # which the kernel inherits
    for run in queue:
        if run.output is not None:
            _execute_copy(run, run.output, root, progress)
        else:
            with tempfile.TemporaryDirectory() as folder:
                copy = Path(folder) / run.path.name
                _execute_copy(run, copy, root, progress)
                _refresh(run.path, copy)
    return [run.output or run.path for run in queue]


def _execute_copy(run: Run, copy: Path, root: Path, progress: bool) -> None:
    """Execute a notebook into a copy, or raise NotebookError."""
    from nbclient.exceptions import DeadKernelError
    from papermill import execute_notebook
    from papermill.exceptions import PapermillExecutionError

    copy.parent.mkdir(parents=True, exist_ok=True)
    kept = "the notebook is unchanged"
    if run.output is not None:
        kept = f"the run up to there is {run.output}"
    for attempts_left in reversed(range(START_ATTEMPTS)):
        try:
            execute_notebook(
                str(run.path.resolve()),
                str(copy.resolve()),
                dict(run.values) or None,
                cwd=str(root),
                progress_bar=progress,
                iopub_timeout=OUTPUT_TIMEOUT,
                raise_on_iopub_timeout=True,
                record_timing=False,
                extra_arguments=KERNEL_ARGUMENTS,
            )
            return
        except PapermillExecutionError as error:
            text = (str(error.evalue).splitlines() or [""])[0]
            reason = f"cell {error.exec_count} failed, {error.ename}: {text}"
            raise NotebookError(f"{run.path}: {reason}; {kept}") from None
        except DeadKernelError:
            reason = "its kernel died (out of memory?)"
            raise NotebookError(f"{run.path}: {reason}; {kept}") from None
        except RuntimeError as error:
            if not attempts_left:
                reason = f"its kernel did not start, {error}"
                raise NotebookError(f"{run.path}: {reason}; {kept}") from None


def _refresh(path: Path, copy: Path) -> None:
    """Write an executed copy over a notebook, without what differs in each run.

    That is papermill's metadata and live widgets; the static output beside a widget
    stays.
    """
    import nbformat

    notebook = nbformat.read(copy, as_version=4)
    for part in (notebook, *notebook.cells):
        part.metadata.pop("papermill", None)
    notebook.metadata.pop("widgets", None)
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            output.get("data", {}).pop("application/vnd.jupyter.widget-view+json", None)
    nbformat.write(notebook, path)
