"""The command `companion notebook`: runs of notebooks with checked parameters."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from companion.pages.notebook import find_notebook, notebooks, project_root
from companion.pages.notebook_runs import Run, execute
from companion.pages.parameters import Parameter, inspect, merge_parameters, read_value
from sidm.config import ConfigError

DEFAULT_OUTPUT = Path("_build/runs")  # folder of executed copies without an `output`


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
    _refuse(arguments)
    if arguments.list:
        for path in paths:
            _show(path)
    else:
        # Check the parameters of all notebooks before the first one runs.
        runs = [_run_of(path, arguments) for path in paths]
        execute(runs, project_root(), arguments.jobs)
    return 0


def _refuse(arguments: argparse.Namespace) -> None:
    changes = arguments.output or arguments.parameter or arguments.file
    if arguments.in_place and changes:
        raise ConfigError(
            "--in-place refreshes a notebook by its defaults: "
            "give it no output and no parameters"
        )
    if arguments.notebook == "all" and arguments.parameter:
        raise ConfigError(
            "-p is for one notebook: name the notebook, "
            "or put the parameter into a file for -f"
        )
    if arguments.jobs is not None and arguments.jobs < 1:
        raise ConfigError(f"--jobs must be at least 1, not {arguments.jobs}")


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
    if output:
        _refuse_notebook(output)
    return Run(path, output, values)


def _refuse_notebook(output: Path) -> None:
    """Refuse to write a run over a notebook of the project, by whatever name."""
    for path in notebooks():
        if output.exists() and path.samefile(output):
            raise ConfigError(
                f"{output} is the notebook {path.name} itself: name another file; "
                "--in-place refreshes a notebook by its defaults"
            )


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


def _show(path: Path) -> None:
    print(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)
    for name, parameter in inspect(path).items():
        declaration = f"{name}: {parameter.kind_text} = {parameter.default}"
        print(f"  {declaration}  # {parameter.help}")
