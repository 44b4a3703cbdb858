"""The parameters that a notebook declares, and values for them, checked.

An unknown name, a wrong type or a value outside its range is an error, never a warning.
A notebook declares its parameters in the one cell tagged `parameters`, one in each
line: `name: type = value  # what it is, its unit`. The types are plain ones (`int`,
`list[float]`) and `Optional[...]` of them, which papermill reads, too. The words after
`#` may end in a range: `from -1 to 1`, `at least 1`, `above 0`, `one of a, b`.
"""

from __future__ import annotations

import ast
import functools
import io
import json
import re
import tokenize
import typing
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Optional

import yaml

from companion.pages.notebook import notebooks
from sidm.config import ConfigError, conform, first_line, parse_value, unknown_name
from sidm.systems import find_system

KINDS: dict[str, Any] = {
    kind.__name__: kind for kind in (bool, int, float, str, list, dict, tuple)
}
KINDS |= {"Optional": Optional, "None": None}
_NUMBER = r"(-?[\d_.]+)"


class Parameter(NamedTuple):
    """One parameter of a notebook."""

    name: str
    kind: Any  # the type of the annotation
    default: str  # source code of the default value
    help: str

    @property
    def value(self) -> Any:
        """The default value."""
        return ast.literal_eval(self.default)

    @property
    def kind_text(self) -> str:
        """Source code of the type."""
        if typing.get_args(self.kind):
            return str(self.kind).replace("typing.", "")
        return self.kind.__name__


def inspect(path: Path) -> dict[str, Parameter]:
    """The parameters of a notebook by name.

    ConfigError says that the file is no notebook, that the notebook declares no
    parameters, or that a parameter has no type that can be checked.
    """
    source = _declarations(path)
    try:
        lines = ast.parse(source).body
    except (SyntaxError, ValueError, RecursionError) as error:
        raise ConfigError(
            f"{path}: the cell of parameters is no Python ({first_line(error)})"
        ) from error
    words = {
        token.start[0]: token.string.lstrip("# ")
        for token in tokenize.generate_tokens(io.StringIO(source).readline)
        if token.type == tokenize.COMMENT
    }
    parameters = {}
    for line in lines:
        if not isinstance(line, ast.AnnAssign) or line.value is None:
            name = ast.unparse(line).partition(" ")[0].rstrip(":")
            raise ConfigError(
                f"{path}: parameter '{name}' has no readable type; "
                "write 'name: type = value  # help'"
            )
        name, default = (
            ast.unparse(line.target),
            ast.get_source_segment(source, line.value),
        )
        kind = _kind(line.annotation, name, path)
        help = words.get(line.end_lineno or 0, "")
        parameters[name] = Parameter(name, kind, default or "", help)
    return parameters


def _declarations(path: Path) -> str:
    try:
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such notebook") from None
    except (ValueError, KeyError, TypeError) as error:
        raise ConfigError(f"{path}: not a notebook ({first_line(error)})") from error
    for cell in cells:
        if "parameters" in cell.get("metadata", {}).get("tags", ()):
            if source := "".join(cell["source"]).strip():
                return source
    raise ConfigError(
        f"{path}: no parameters; tag one cell 'parameters', "
        "each line 'name: type = value  # help'"
    )


def _kind(annotation: ast.expr, name: str, path: Path) -> Any:
    try:
        return _type(annotation)
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise ConfigError(
            f"{path}: parameter '{name}' has the unknown type "
            f"'{ast.unparse(annotation)}'; use {', '.join(KINDS)}"
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
    """A value converted to its type, else ConfigError with the parameter's name.

    A tuple becomes a list, since papermill writes the value into a notebook.
    """
    checked = conform(value, kind, name)
    return list(checked) if isinstance(checked, tuple) else checked


def read_value(text: str, kind: Any, name: str) -> Any:
    """The value of a parameter from the command line: YAML, or the string itself.

    Text that is no YAML, or of another type, raises ConfigError.
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

    Each name `given` must be a parameter of this notebook. A later file wins over an
    earlier one, `given` wins over all; each name in a file must be a parameter of some
    notebook of the project, and those of other notebooks are left out. An unknown name,
    with the nearest right one, or a value of the wrong type raises ConfigError.
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
    for name, value in merged.items():
        refuse_out_of_range(value, parameters[name])
    return merged


def refuse_out_of_range(value: Any, parameter: Parameter) -> None:
    """Refuse a value that the words about a parameter exclude, or an unknown name.

    A list that has values by default must have one. Parameters called `preset`,
    `policy`, `system`, `systems`, `first` and `second` are names of presets, policies,
    pairs of robots and robots in every notebook. The message of the ConfigError has the
    range.
    """
    several = isinstance(value, list | tuple)
    if several and not value and parameter.default not in ("", "[]"):
        raise ConfigError(f"'{parameter.name}' must have at least one value")
    for one in value if several else [value]:
        if parameter.name in _FINDERS and one is not None:
            _FINDERS[parameter.name](one)
        for words, holds in _RANGES.items():
            found = re.search(words, parameter.help)
            if found and one is not None and not holds(one, *found.groups()):
                raise ConfigError(
                    f"'{parameter.name}' must be {found[0].rstrip('.')}, not {one!r}"
                )


def _find_preset(name: str) -> None:
    from companion.presets import load_preset

    load_preset(name)


def _find_policy(name: str) -> None:
    from companion.presets import POLICIES

    if name not in POLICIES:
        raise unknown_name(name, POLICIES, kind="policy")


def _find_robot(name: str) -> None:
    from ownrobot.replay import find_robot

    find_robot(name)


#: name of a parameter -> finds what its value names, or raises ConfigError
_FINDERS = {
    "preset": _find_preset,
    "policy": _find_policy,
    "system": find_system,
    "systems": find_system,
    "first": _find_robot,
    "second": _find_robot,
}
#: how a range is written -> whether a value lies in it
_RANGES: dict[str, Callable[..., bool]] = {
    f"from {_NUMBER} to {_NUMBER}": lambda x, low, high: float(low) <= x <= float(high),
    f"at least {_NUMBER}": lambda x, low: x >= float(low),
    f"above {_NUMBER}": lambda x, low: x > float(low),
    r"one of (.+)$": lambda x, names: x in re.split(", | or ", names),
}


@functools.cache
def _names(path: Path) -> frozenset[str]:
    """The names of a notebook's parameters, read once in a process."""
    return frozenset(inspect(path))


def _read_file(path: Path) -> dict[str, Any]:
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
