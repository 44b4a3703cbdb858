"""Strict runs of the notebooks through papermill: an unknown parameter or a wrong type is an error, never a warning.

A notebook's parameters stand in its one cell tagged `parameters`, a line each: `name:
type = value  # what it is, its unit`. The types that papermill can read there are plain
ones (`int`, `list[float]`) and `Optional[...]` of them.
"""

from __future__ import annotations

import argparse
import ast
import functools
import os
import re
import typing
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Optional

import yaml

from companion.pages.notebook_runs import Run, execute
from sidm.config import ConfigError, conform, first_line, hint, parsed, unknown_name

DEFAULT_OUTPUT = Path("_build/runs")  # where a run goes that names no output
KINDS: dict[str, Any] = {
    kind.__name__: kind for kind in (bool, int, float, str, list, dict, tuple)
}
KINDS |= {"Optional": Optional, "None": None}
#: Chapters that others took in, or that were called otherwise.
RENAMED = {
    "variants": "least-squares",
    "released": "choices",
    "elsewhere": "recorded-robot",
}


class Parameter(NamedTuple):
    """One line of a notebook's `parameters` cell."""

    name: str
    kind: Any  # the annotation, as a type
    default: str  # as written
    help: str

    @property
    def kind_words(self) -> str:
        """The type as it is written."""
        return (
            str(self.kind).replace("typing.", "")
            if typing.get_args(self.kind)
            else self.kind.__name__
        )


def project_root(start: Path | None = None) -> Path:
    """The nearest folder above `start` (the working folder) that is a project, or the package's own."""
    here = Path(start or Path.cwd()).resolve()
    for folder in (here, *here.parents):
        if (folder / "notebooks").is_dir() and (
            folder / "companion" / "pages"
        ).is_dir():
            return folder
    return Path(__file__).resolve().parents[2]


def enter_project() -> Path:
    """Make the project's folder the working one: `results` and `data` are the same then, however a notebook is run."""
    root = project_root()
    os.chdir(root)
    return root


def notebooks(root: Path | None = None) -> list[Path]:
    """The project's notebooks in reading order."""
    return sorted((root or project_root()).glob("notebooks/*.ipynb"))


def find_notebook(name: str) -> Path:
    """The notebook of that path or name: `05-figure3` and `figure3` are notebooks/05-figure3.ipynb; numbers may be old.

    Raises:
        ConfigError: there is none; it names the nearest.
    """
    if Path(name).is_file():
        return Path(name)
    known = {path.stem: path for path in notebooks()}
    wanted = _without_number(Path(name).name.removesuffix(".ipynb"))
    for stem, path in known.items():
        if RENAMED.get(wanted, wanted) == _without_number(stem):
            return path
    raise ConfigError(f"no notebook '{name}'; {hint(name, known)}")


def _without_number(stem: str) -> str:
    return re.sub(r"^\d+-", "", stem)


def inspect(path: Path) -> dict[str, Parameter]:
    """The parameters of a notebook; ConfigError when it declares none or one has no type that can be checked."""
    from papermill import inspect_notebook

    try:
        lines = inspect_notebook(str(path))
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such notebook") from None
    except Exception as error:  # whatever nbformat raises on a file that is no notebook
        raise ConfigError(f"{path}: not a notebook ({first_line(error)})") from error
    if not lines:
        raise ConfigError(
            f"{path}: no parameters; tag one cell 'parameters', each line 'name: type = value  # help'"
        )
    return {
        name: Parameter(
            name,
            _kind(line["inferred_type_name"], name, path),
            line["default"],
            line["help"],
        )
        for name, line in lines.items()
    }


def _kind(annotation: str, name: str, path: Path) -> Any:
    """The type that an annotation's text names."""
    # papermill's word for a line without one, or with one that it cannot read
    if annotation == "None":
        raise ConfigError(
            f"{path}: parameter '{name}' has no readable type; write 'name: type = value  # help'"
        )
    try:
        return _type(ast.parse(annotation, mode="eval").body)
    except (SyntaxError, KeyError, TypeError, ValueError, RecursionError) as error:
        known = ", ".join(KINDS)
        raise ConfigError(
            f"{path}: parameter '{name}' has the unknown type '{annotation}'; use {known}"
        ) from error


def _type(node: ast.expr) -> Any:
    """The type that an annotation's syntax tree names; nothing of it is executed."""
    if isinstance(node, ast.Constant) and node.value is None:
        return None
    if isinstance(node, ast.Name):
        return KINDS[node.id]
    if not isinstance(node, ast.Subscript):
        raise ValueError("not a type")
    inner = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    kinds = tuple(
        ... if isinstance(one, ast.Constant) and one.value is ... else _type(one)
        for one in inner
    )
    return _type(node.value)[kinds if len(kinds) > 1 else kinds[0]]


def check(value: Any, kind: Any, name: str) -> Any:
    """`value` as `kind` asks, in a form that papermill can write into a notebook (lists for tuples).

    Raises:
        ConfigError: it is of another kind; `name` is the parameter's.
    """
    checked = conform(value, kind, name)
    return list(checked) if isinstance(checked, tuple) else checked


def read_value(text: str, kind: Any, name: str) -> Any:
    """The value that a command line's `text` stands for: YAML, checked against `kind`; `text` itself for a string.

    Raises:
        ConfigError: it is no YAML, or of another kind; `name` is the parameter's.
    """
    if kind is str:
        return text
    value = parsed(text, name)
    if kind == Optional[str]:  # noqa: UP045 - as the notebooks write it
        return None if value is None else text
    return check(value, kind, name)


def merge_parameters(
    path: Path, given: Mapping[str, Any], files: Iterable[Path] = ()
) -> dict[str, Any]:
    """The checked parameters of one run: the files' in their order, then those given by hand.

    A name given by hand must be this notebook's; a name in a file must be known to some
    notebook of the project and is left out where it is another's. ConfigError names the
    nearest right name, or the type that is asked for.
    """
    own = inspect(path)
    merged: dict[str, Any] = {}
    for file in files:
        values = _read_file(Path(file))
        everywhere = {
            name for other in notebooks() for name in _names(other.resolve())
        } | set(own)
        for name, value in values.items():
            if name not in everywhere:
                raise unknown_name(
                    name, sorted(everywhere), f"{file} (no notebook has it)"
                )
            if name in own:
                merged[name] = check(value, own[name].kind, f"{file}: {name}")
    for name, value in given.items():
        if name not in own:
            raise unknown_name(name, own, Path(path).name)
        merged[name] = check(value, own[name].kind, name)
    return merged


@functools.cache
def _names(path: Path) -> frozenset[str]:
    """The parameters of a notebook by name, read once in a process."""
    return frozenset(inspect(path))


def _read_file(path: Path) -> dict[str, Any]:
    """The mapping in a parameter file."""
    try:
        values = yaml.safe_load(path.read_text())
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such parameter file") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not YAML ({first_line(error)})") from None
    if not isinstance(values, dict):
        raise ConfigError(
            f"{path}: a parameter file is a mapping 'name: value', not {type(values).__name__}"
        )
    strange = [name for name in values if not isinstance(name, str)]
    if strange:
        raise ConfigError(f"{path}: a parameter's name is text, not {strange[0]!r}")
    return values


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `companion notebook`."""
    add = parser.add_argument
    add("notebook", help="its name, with or without the number, or its path; or 'all'")
    add(
        "output",
        nargs="?",
        type=Path,
        help=f"the executed copy, for 'all' a folder; else it goes to {DEFAULT_OUTPUT}",
    )
    many: dict[str, Any] = {"action": "append", "default": []}
    add(
        "-p",
        "--parameter",
        nargs=2,
        metavar=("NAME", "VALUE"),
        help="one parameter, by hand",
        **many,
    )
    add(
        "-f",
        "--file",
        type=Path,
        metavar="YAML",
        help="parameters of a preset, as params/smoke.yaml",
        **many,
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
    """Carry out `companion notebook`.

    Raises:
        ConfigError: arguments that cannot be used; nothing is run.
        NotebookError: a notebook failed.
    """
    paths = (
        notebooks()
        if arguments.notebook == "all"
        else [find_notebook(arguments.notebook)]
    )
    _refuse(arguments)
    if arguments.list:
        for path in paths:
            _show(path)
    else:
        # all of them checked before the first is run
        wanted = [_wanted(path, arguments) for path in paths]
        execute(wanted, project_root(), arguments.jobs)
    return 0


def _refuse(arguments: argparse.Namespace) -> None:
    """ConfigError for arguments that do not go together."""
    if arguments.in_place and (
        arguments.output or arguments.parameter or arguments.file
    ):
        raise ConfigError(
            "--in-place keeps a notebook's own outputs: give it no output and no parameters"
        )
    if arguments.notebook == "all" and arguments.parameter:
        raise ConfigError(
            "-p is one notebook's: name the notebook, or put the parameter into a file for -f"
        )
    if arguments.jobs is not None and arguments.jobs < 1:
        raise ConfigError(f"--jobs must be at least 1, not {arguments.jobs}")


def _wanted(path: Path, arguments: argparse.Namespace) -> Run:
    """How a notebook is to be run, its parameters checked."""
    own = inspect(path)
    given: dict[str, Any] = dict(arguments.parameter)
    given |= {
        name: read_value(text, own[name].kind, name)
        for name, text in given.items()
        if name in own
    }
    values, output = merge_parameters(path, given, arguments.file), arguments.output
    if not arguments.in_place and (arguments.notebook == "all" or not output):
        output = (output or DEFAULT_OUTPUT) / path.name
    return Run(path, output, values)


def _show(path: Path) -> None:
    print(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)
    for name, parameter in inspect(path).items():
        print(
            f"  {name}: {parameter.kind_words} = {parameter.default}  # {parameter.help}"
        )
