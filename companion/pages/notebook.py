"""The project's notebooks and their parameters, with strict checks.

An unknown parameter or a wrong type is an error, never a warning. A notebook declares
its parameters in the one cell tagged `parameters`, one in each line: `name: type =
value  # what it is, its unit`. The types there are what papermill can read: plain types
(`int`, `list[float]`) and `Optional[...]` of them.
"""

from __future__ import annotations

import ast
import functools
import os
import re
import sys
import typing
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Optional

import yaml

from sidm.command_line import print_notices
from sidm.config import (
    ConfigError,
    conform,
    first_line,
    hint,
    parse_value,
    unknown_name,
)

KINDS: dict[str, Any] = {
    kind.__name__: kind for kind in (bool, int, float, str, list, dict, tuple)
}
KINDS |= {"Optional": Optional, "None": None}
#: Former name of a chapter -> its name now, or the chapter that has its contents.
RENAMED = {
    "variants": "least-squares",
    "released": "choices",
    "elsewhere": "recorded-robot",
    "training": "method",
    "why": "how-long",
    "baselines": "rivals",
    "ablation-p-expert": "p-expert-and-phases",
    "ablation-phases": "p-expert-and-phases",
}


class Parameter(NamedTuple):
    """One parameter of a notebook."""

    name: str
    kind: Any  # the type of the annotation
    default: str  # source code of the default value
    help: str

    @property
    def kind_text(self) -> str:
        """Source code of the type."""
        if typing.get_args(self.kind):
            return str(self.kind).replace("typing.", "")
        return self.kind.__name__


def project_root(start: Path | None = None) -> Path:
    """The project's folder that has `start` inside.

    Args:
        start: a folder; by default the working folder.

    Returns:
        The nearest folder above `start` with notebooks and this package, or the folder
        of this file's project where there is none.
    """
    start = Path(start or Path.cwd()).resolve()
    for folder in (start, *start.parents):
        parts = (folder / "notebooks", folder / "companion" / "pages")
        if all(part.is_dir() for part in parts):
            return folder
    return Path(__file__).resolve().parents[2]


def enter_project() -> Path:
    """Make the project's folder the working folder, and return it.

    Then `results` and `data` are the project's, however a notebook is run. Notices are
    lines of the page, as on the command line; figures can be stacked on narrow pages.
    """
    from companion.figures.stacked import show_stackable

    print_notices(sys.stdout)
    show_stackable()
    root = project_root()
    os.chdir(root)
    return root


def notebooks(root: Path | None = None) -> list[Path]:
    """The project's notebooks in reading order."""
    return sorted((root or project_root()).glob("notebooks/*.ipynb"))


def find_notebook(name: str) -> Path:
    """The notebook with this path or name.

    Args:
        name: a path; or a name with or without its number, as `04-figure3` or
            `figure3`. The number is ignored, and former names of chapters are known.

    Raises:
        ConfigError: there is none; the message has the nearest name.
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
    """The parameters of a notebook by name.

    Raises:
        ConfigError: the file is no notebook, the notebook declares no parameters, or a
            parameter has no type that can be checked.
    """
    from papermill import inspect_notebook

    try:
        lines = inspect_notebook(str(path))
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such notebook") from None
    except Exception as error:  # nbformat raises many types for other files
        raise ConfigError(f"{path}: not a notebook ({first_line(error)})") from error
    if not lines:
        raise ConfigError(
            f"{path}: no parameters; tag one cell 'parameters', "
            "each line 'name: type = value  # help'"
        )
    parameters = {}
    for name, line in lines.items():
        kind = _kind(line["inferred_type_name"], name, path)
        parameters[name] = Parameter(name, kind, line["default"], line["help"])
    return parameters


def _kind(annotation: str, name: str, path: Path) -> Any:
    """The type that the source code of an annotation stands for."""
    # papermill gives "None" where there is no annotation or it cannot read it
    if annotation == "None":
        raise ConfigError(
            f"{path}: parameter '{name}' has no readable type; "
            "write 'name: type = value  # help'"
        )
    try:
        return _type(ast.parse(annotation, mode="eval").body)
    except (SyntaxError, KeyError, TypeError, ValueError, RecursionError) as error:
        raise ConfigError(
            f"{path}: parameter '{name}' has the unknown type '{annotation}'; "
            f"use {', '.join(KINDS)}"
        ) from error


def _type(node: ast.expr) -> Any:
    """The type that the syntax tree of an annotation stands for; runs no code."""
    if isinstance(node, ast.Constant) and node.value is None:
        return None
    if isinstance(node, ast.Name):
        return KINDS[node.id]
    if not isinstance(node, ast.Subscript):
        raise ValueError("not a type")
    items = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    kinds = tuple(
        ... if isinstance(item, ast.Constant) and item.value is ... else _type(item)
        for item in items
    )
    return _type(node.value)[kinds if len(kinds) > 1 else kinds[0]]


def check(value: Any, kind: Any, name: str) -> Any:
    """A value converted to its type.

    Args:
        value: the value.
        kind: the type.
        name: name of the parameter, for error messages.

    Returns:
        The value in a form that papermill can write into a notebook: a list for a
        tuple.

    Raises:
        ConfigError: the value has another type.
    """
    checked = conform(value, kind, name)
    return list(checked) if isinstance(checked, tuple) else checked


def read_value(text: str, kind: Any, name: str) -> Any:
    """The value of a parameter that is given on the command line.

    Args:
        text: the value in YAML; for a string, the string itself.
        kind: the type.
        name: name of the parameter, for error messages.

    Raises:
        ConfigError: the text is no YAML, or the value has another type.
    """
    if kind is str:
        return text
    value = parse_value(text, name)
    if kind == Optional[str]:  # noqa: UP045 - as in the notebooks
        return None if value is None else text
    return check(value, kind, name)


def merge_parameters(
    path: Path, given: Mapping[str, Any], files: Iterable[Path] = ()
) -> dict[str, Any]:
    """The checked parameters of one run of a notebook.

    Args:
        path: the notebook.
        given: single values, which win over all files. Each name must be a parameter of
            this notebook.
        files: YAML files with values; a later file wins over an earlier one. Each name
            must be a parameter of some notebook of the project; parameters of other
            notebooks are left out.

    Raises:
        ConfigError: an unknown name, with the nearest right one; or a value of the
            wrong type.
    """
    parameters = inspect(path)
    merged: dict[str, Any] = {}
    for file in files:
        values = _read_file(Path(file))
        known = set(parameters).union(*(_names(each.resolve()) for each in notebooks()))
        for name, value in values.items():
            if name not in known:
                raise unknown_name(
                    name, sorted(known), f"{file} (no notebook has it)", "parameter"
                )
            if name in parameters:
                merged[name] = check(value, parameters[name].kind, f"{file}: {name}")
    for name, value in given.items():
        if name not in parameters:
            raise unknown_name(name, parameters, Path(path).name, "parameter")
        merged[name] = check(value, parameters[name].kind, name)
    return merged


@functools.cache
def _names(path: Path) -> frozenset[str]:
    """The names of a notebook's parameters, read once in a process."""
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
            f"{path}: a parameter file is a mapping 'name: value', "
            f"not {type(values).__name__}"
        )
    for name in values:
        if not isinstance(name, str):
            raise ConfigError(f"{path}: a parameter's name is text, not {name!r}")
    return values
