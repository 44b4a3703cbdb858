"""The command `companion notebook`: papermill with checked parameters.

Several notebooks run side by side, each with its own kernel.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from companion.pages.notebook import find_notebook, notebooks, project_root
from companion.pages.parameters import Parameter, inspect, merge_parameters, read_value
from sidm.config import ConfigError
from sidm.pool import as_completed, local_pool
from sidm.progress import progress_bar

DEFAULT_OUTPUT = Path("_build/runs")  # folder of executed copies without an `output`
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


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `companion notebook` to its parser."""
    add = parser.add_argument
    add("notebook", help="its name, with or without the number, or its path; or 'all'")
    add(
        "output",
        nargs="?",
        type=Path,
        help=f"the executed copy, for 'all' a folder; else it goes to {DEFAULT_OUTPUT}",
    )
    repeated: dict[str, Any] = {"action": "append", "default": []}
    add(
        "-p",
        "--parameter",
        nargs=2,
        metavar=("NAME", "VALUE"),
        help="one parameter, by hand",
        **repeated,
    )
    add(
        "-f",
        "--file",
        type=Path,
        metavar="YAML",
        help="parameters of a preset, as params/smoke.yaml",
        **repeated,
    )
    add(
        "--jobs",
        type=int,
        metavar="N",
        help="how many of 'all' run side by side; one a core unless given",
    )
    add(
        "--in-place",
        action="store_true",
        help="refresh the outputs in the notebook itself, by its defaults",
    )
    add("--list", action="store_true", help="show the parameters and run nothing")


def run_from_arguments(arguments: argparse.Namespace) -> int:
    """Carry out `companion notebook`; returns the exit status, 0.

    ConfigError says that an argument has a fault, and no notebook was run;
    NotebookError, that a notebook failed.
    """
    is_all = arguments.notebook == "all"
    paths = notebooks() if is_all else [find_notebook(arguments.notebook)]
    if arguments.in_place and (
        arguments.output or arguments.parameter or arguments.file
    ):
        raise ConfigError(
            "--in-place refreshes a notebook by its defaults: "
            "give it no output and no parameters"
        )
    if is_all and arguments.parameter:
        raise ConfigError(
            "-p is for one notebook: name the notebook, "
            "or put the parameter into a file for -f"
        )
    if arguments.jobs is not None and arguments.jobs < 1:
        raise ConfigError(f"--jobs must be at least 1, not {arguments.jobs}")
    if arguments.list:
        for path in paths:
            _show(path)
    else:
        # Check the parameters of all notebooks before the first one runs.
        execute([_run_of(path, arguments) for path in paths], arguments.jobs)
    return 0


def _show(path: Path) -> None:
    """Print a notebook's parameters."""
    print(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)
    for name, annotation, default, help in inspect(path).values():
        print(f"  {name}: {annotation} = {default}  # {help}")


def _run_of(path: Path, arguments: argparse.Namespace) -> Run:
    """The run of a notebook that the arguments ask for, with checked parameters."""
    parameters = inspect(path)
    given: dict[str, Any] = dict(arguments.parameter)
    for name, text in given.items():
        if name in parameters:
            value = read_value(text, parameters[name].kind, name)
            given[name] = _from_here(value, parameters[name])
    values, output = merge_parameters(path, given, arguments.file), arguments.output
    if not arguments.in_place and (arguments.notebook == "all" or not output):
        output = (output or DEFAULT_OUTPUT) / path.name
    if output and output.exists():
        for original in notebooks():
            if original.samefile(output):  # by whatever name
                raise ConfigError(
                    f"{output} is the notebook {original.name} itself: name another "
                    "file; --in-place refreshes a notebook by its defaults"
                )
    return Run(path, output, values)


def _from_here(value: Any, parameter: Parameter) -> Any:
    """The value of a parameter, with a path read from where the user stands.

    Notebooks run in the project's folder. A text is a path if its parameter is for a
    folder, or if it names a file or a folder that is here.
    """
    if not isinstance(value, str) or Path.cwd() == project_root():
        return value
    path = Path.cwd() / value
    is_folder = parameter.help.startswith("folder")
    is_file = "/" in parameter.default and path.exists()
    return str(path) if is_folder or is_file else value


def execute(runs: Sequence[Run], jobs: int | None = None) -> None:
    """Execute notebooks in parallel, in the project's folder.

    Notebooks that run missing trials run one after the other, because they use each
    other's trials. When a notebook fails, its copy keeps the outputs up to the error; a
    notebook that was to be refreshed stays as it was; the other kernels end, and
    NotebookError is raised. `jobs` is the number of kernels at a time, of one thread
    each if there are several; by default the number of cores.
    """
    dependent = [run for run in runs if run.values.get("run_missing")]
    queues = [dependent] if dependent else []
    queues += [[run] for run in runs if run not in dependent]
    jobs = min(jobs or _cores(), len(queues))
    several = len(runs) > 1
    with (
        progress_bar(len(runs), "notebooks", "notebook", several) as bar,
        local_pool(jobs) as pool,
    ):
        work = (project_root(), jobs > 1, not several and sys.stderr.isatty())
        futures = [pool.submit(_execute_queue, queue, *work) for queue in queues]
        for done in as_completed(futures):
            for path in done.result():
                bar.write(str(path), file=sys.stdout)
                bar.update()


def _cores() -> int:
    """The number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _execute_queue(
    queue: Sequence[Run], root: Path, one_thread: bool, progress: bool
) -> list[Path]:
    """Execute notebooks one after the other; returns what was written."""
    if one_thread:
        os.environ.setdefault("OMP_NUM_THREADS", "1")  # which the kernel inherits
    for run in queue:
        with tempfile.TemporaryDirectory() as folder:
            copy = run.output or Path(folder) / run.path.name
            copy.parent.mkdir(parents=True, exist_ok=True)
            if fault := _execute(run, copy, root, progress):
                kept = "the notebook is unchanged"
                if run.output:
                    kept = f"the run up to there is {run.output}"
                raise NotebookError(f"{run.path}: {fault}; {kept}")
            if not run.output:
                _refresh(run.path, copy)
    return [run.output or run.path for run in queue]


def _execute(run: Run, copy: Path, root: Path, progress: bool) -> str:
    """Execute a notebook into a copy; returns what went wrong, '' if nothing did."""
    from nbclient.exceptions import DeadKernelError
    from papermill import execute_notebook
    from papermill.exceptions import PapermillExecutionError

    fault = ""
    for _ in range(START_ATTEMPTS):
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
            return ""
        except PapermillExecutionError as error:
            text = (str(error.evalue).splitlines() or [""])[0]
            return f"cell {error.exec_count} failed, {error.ename}: {text}"
        except DeadKernelError:
            return "its kernel died (out of memory?)"
        except RuntimeError as error:
            fault = f"its kernel did not start, {error}"
    return fault


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
