"""The parameters that a notebook declares, and values for them, checked.

An unknown name, a wrong type or a value outside its range is an error, never a warning.
A notebook declares its parameters in the one cell tagged `parameters`, one in each
line: `name: type = value  # what it is, its unit`. The types are those of `KINDS`,
which papermill reads, too. The words after `#` may end in a range: `from -1 to 1`,
`at least 1`, `above 0`, `one of a, b`.
"""

from __future__ import annotations

import ast
import functools
import json
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Optional

import yaml

from companion.pages.notebook import project_root
from ownrobot.command_line import parse_value
from sidm.config import ConfigError, conform, first_line, unknown_name
from sidm.systems import find_system

_PLAIN = (bool, int, float, str)
#: annotation of a parameter -> its type
KINDS: dict[str, Any] = {kind.__name__: kind for kind in (*_PLAIN, list, dict)}
KINDS |= {f"list[{kind.__name__}]": list[kind] for kind in _PLAIN}  # type: ignore[valid-type]
KINDS |= {f"Optional[{kind.__name__}]": Optional[kind] for kind in _PLAIN}  # noqa: UP045
_DECLARATION = re.compile(r"(\w+)\s*:\s*([^=]+?)\s*=\s*(.+?)(?:\s+#\s*(.*))?")
_NUMBER = r"(-?[\d_.]+)"
#: how a range is written -> whether a value lies in it
_RANGES: dict[str, Callable[..., bool]] = {
    f"from {_NUMBER} to {_NUMBER}": lambda x, low, high: float(low) <= x <= float(high),
    f"at least {_NUMBER}": lambda x, low: x >= float(low),
    f"above {_NUMBER}": lambda x, low: x > float(low),
    r"one of (.+)$": lambda x, names: x in re.split(", | or ", names),
}


class Parameter(NamedTuple):
    """One parameter of a notebook, as its line of source code."""

    name: str
    annotation: str
    default: str
    help: str

    @property
    def kind(self) -> Any:
        """The type of the annotation."""
        return KINDS[self.annotation]

    @property
    def value(self) -> Any:
        """The default value."""
        return ast.literal_eval(self.default)


def inspect(path: Path) -> dict[str, Parameter]:
    """The parameters of a notebook by name; runs no code.

    ConfigError says that the file is no notebook, that the notebook declares no
    parameters, or that a parameter has no type that can be checked.
    """
    found = {}
    for line in _declarations(path).splitlines():
        if not line.strip() or line.startswith("#"):
            continue
        words = _DECLARATION.fullmatch(line.strip())
        if not words or words[2] not in KINDS:
            raise ConfigError(
                f"{path}: parameter '{line[:60]}' has no readable type; "
                f"write 'name: type = value  # help' with one of {', '.join(KINDS)}"
            )
        found[words[1]] = Parameter(words[1], words[2], words[3], words[4] or "")
    return found


def _declarations(path: Path) -> str:
    """The source of the cell of parameters."""
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


def read_value(text: str, kind: Any, name: str) -> Any:
    """The value of a parameter from the command line: YAML, or the string itself.

    Text that is no YAML, or of another type, raises ConfigError.
    """
    if kind is str:
        return text
    value = parse_value(text, name)
    if kind == Optional[str]:  # noqa: UP045 - as in the notebooks
        return None if value is None else text
    return conform(value, kind, name)


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
        for name, value in _read_file(Path(file)).items():
            if name in parameters:
                merged[name] = conform(value, parameters[name].kind, f"{file}: {name}")
            elif name not in (known := _all_names(project_root() / "notebooks")):
                where = f"{file} (no notebook has it)"
                raise unknown_name(name, {*known, *parameters}, where, "parameter")
    for name, value in given.items():
        if name not in parameters:
            raise unknown_name(name, parameters, Path(path).name, "parameter")
        merged[name] = conform(value, parameters[name].kind, name)
    for name, value in merged.items():
        refuse_out_of_range(value, parameters[name])
    return merged


@functools.cache
def _all_names(folder: Path) -> frozenset[str]:
    """The names of all parameters in a folder's notebooks, read once in a process."""
    return frozenset(name for path in folder.glob("*.ipynb") for name in inspect(path))


def _read_file(path: Path) -> dict[str, Any]:
    """The values in a YAML file of parameters by name; else ConfigError."""
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


def refuse_out_of_range(value: Any, parameter: Parameter) -> None:
    """Refuse a value that the words about a parameter exclude, or an unknown name.

    A list that has values by default must have one. The message of the ConfigError has
    the range.
    """
    several = isinstance(value, list | tuple)
    if several and not value and parameter.default not in ("", "[]"):
        raise ConfigError(f"'{parameter.name}' must have at least one value")
    for one in value if several else [value]:
        if one is None:
            continue
        _refuse_unknown(parameter.name, one)
        for words, holds in _RANGES.items():
            found = re.search(words, parameter.help)
            if found and not holds(one, *found.groups()):
                raise ConfigError(
                    f"'{parameter.name}' must be {found[0].rstrip('.')}, not {one!r}"
                )


def _refuse_unknown(parameter: str, name: Any) -> None:
    """Refuse a name that is not known; some parameters are names in every notebook."""
    if parameter in ("system", "systems"):
        find_system(name)
    elif parameter in ("first", "second"):
        from ownrobot.replay import find_robot

        find_robot(name)
    elif parameter in ("preset", "policy"):
        from companion.presets import POLICIES, load_preset

        if parameter == "preset":
            load_preset(name)
        elif name not in POLICIES:
            raise unknown_name(name, POLICIES, kind="policy")
