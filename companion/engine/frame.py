"""Results as one tidy pandas table: a row a trial, a column a value.

Grouping, pivoting and joining are done with pandas.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import typing
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import docstring_parser
import pandas as pd
from docstring_parser import DocstringStyle

from companion.engine import known_motion
from companion.engine.known_motion import Known, again_elsewhere
from companion.engine.provenance import Provenance, are_stale
from companion.engine.rows import CURVES, Outcome, Row
from companion.training import StudyTraining
from companion.trials import Trial
from sidm.body import Body
from sidm.config import to_mapping
from sidm.settings import Network

#: The classes whose fields are columns of a trial's row, and the prefix of their names.
_PARTS: tuple[tuple[type, str], ...] = (
    (Trial, ""),
    (Network, ""),
    (StudyTraining, ""),
    (StudyTraining, "pretraining_"),
    (Outcome, ""),
    (Provenance, ""),
)
_FLAGS = [
    ("stale", "bool", "whether today's code would come to other figures"),
    (
        "repeated",
        "bool",
        "whether its motion was simulated again elsewhere and differs by rounding",
    ),
]


def frame_of(rows: Iterable[Row]) -> pd.DataFrame:
    """Rows as a table, see `table_of`."""
    return table_of((row.trial.key, to_mapping(row)) for row in rows)


def table_of(
    rows: Iterable[tuple[str, Mapping[str, Any]]],
    results: str | Path = "results",
    curves: bool = True,
) -> pd.DataFrame:
    """Rows as a table, by the key of their trial; each is its key and its values.

    Values of the trial, its network, training, outcome and provenance are columns of
    their own names; those of a pretraining have ``pretraining_`` before them and are
    missing where there is none. `columns` says what each is, with its unit. Curves and
    paths, tuples in a cell, are there where `curves` says so. `stale` tells what older
    code made, `repeated` what was made with motion that `results` know from another
    machine. A table without rows has numbers where others have them, so that joined
    with them it changes no type.
    """
    known, lines, keys = known_motion.read(results), [], []
    for key, row in rows:
        values = settings_of(row["trial"])
        lines.append(values | _tuples(row["outcome"]) | _made(row, known))
        keys.append(key)
    kinds = {name: kind for name, kind, _ in columns(curves)}
    index = pd.Index(keys, name="key")
    table = pd.DataFrame(lines, columns=[*kinds], index=index)
    if lines:
        return table
    numbers = ("int", "float", "bool")
    typed = table.astype({name: k for name, k in kinds.items() if k in numbers})
    return typed.copy()  # pandas warns of a table in many pieces


def settings_of(trial: Mapping[str, Any]) -> dict[str, Any]:
    """The settings of a trial by name, as in `table_of`; a body is its name."""
    parts = {name: trial[name] for name in ("network", "training")}
    others = {name: value for name, value in trial.items() if name not in parts}
    return _flat(others | parts["network"] | parts["training"])


def columns(curves: bool = True) -> list[tuple[str, str, str]]:
    """Name, type and description, with its unit, of every column of `frame_of`."""
    left_out = {"network", "training", "pretraining"}  # their values are columns
    left_out |= set() if curves else set(CURVES)
    described = [
        (f"{prefix}{name}", kind, text)
        for cls, prefix in _PARTS
        for name, (kind, text) in _described(cls).items()
        if name not in left_out
    ]
    return [*described, *_FLAGS]


def _made(record: Mapping[str, Any], known: Mapping[str, Known]) -> dict[str, Any]:
    """How a record was made: the columns of its provenance and of _FLAGS."""
    made = record["provenance"]
    stale = are_stale(made["numerics"])
    repeated = again_elsewhere(made["digests"], known)
    return {**made, "stale": stale, "repeated": repeated}


def numbers_and_words(frame: pd.DataFrame) -> pd.DataFrame:
    """The columns of a table whose cells hold one value each, for files such as CSV."""
    scalar = [name for name in frame if frame[name].map(pd.api.types.is_scalar).all()]
    return frame[scalar]


def records_frame(
    kind: type, records: Iterable[Mapping[str, Any]], results: str | Path = "results"
) -> pd.DataFrame:
    """The values of records of one kind as a table, a row a record.

    The fields of a record's `about` are columns of the same names. The fields of a part
    of it have the part's name as prefix (``training_batch``) and are missing where
    there is no such part; those of a trial have it where the table has the shorter name
    too. A result that has the name of a field of the provenance gets the prefix
    ``found_`` (``found_seconds``).
    """
    made_by = [*_names(Provenance), *(name for name, _, _ in _FLAGS)]
    column = {
        field.name: f"found_{field.name}" if field.name in made_by else field.name
        for field in dataclasses.fields(kind)
        if field.name not in ("about", "provenance")
    }
    known, lines = known_motion.read(results), []
    for record in records:
        found = _tuples({column[name]: record[name] for name in column})
        lines.append(_flat(record["about"]) | found | _made(record, known))
    names = _names(typing.get_type_hints(kind)["about"])
    frame = pd.DataFrame(lines, columns=[*names, *column.values(), *made_by])
    shorter = {name: name.removeprefix("trial_") for name in frame}
    return frame.rename(columns={k: v for k, v in shorter.items() if v not in frame})


def _names(cls: type, prefix: str = "") -> Iterator[str]:
    """Columns of a `config` class; those of a part have the part's name as prefix."""
    hints = typing.get_type_hints(cls)
    for field in dataclasses.fields(cls):
        hint = hints[field.name]
        parts = filter(dataclasses.is_dataclass, (hint, *typing.get_args(hint)))
        part = next(parts, None)
        name = f"{prefix}{field.name}"
        if part in (None, Body) or typing.get_origin(hint) is tuple:
            yield name
        else:
            yield from _names(part, f"{name}_")  # type: ignore[arg-type]


def _flat(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """One level of values by name; a body is its name."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        if not isinstance(value, dict):
            flat[f"{prefix}{name}"] = value
        elif name.endswith("_body"):
            flat[f"{prefix}{name}"] = value["name"]
        else:
            flat |= _flat(value, f"{prefix}{name}_")
    return _tuples(flat)


def _tuples(value: Any) -> Any:
    """A value, or the values of a dictionary, with tuples for the lists of a file."""
    if isinstance(value, dict):
        lists = {n: _tuples(v) for n, v in value.items() if isinstance(v, list)}
        return value | lists
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


@functools.cache
def _described(cls: type) -> dict[str, tuple[str, str]]:
    """Field -> its type, and its text in the Attributes of the class's docstring."""
    described: dict[str, tuple[str, str]] = {}
    for parent in filter(dataclasses.is_dataclass, reversed(cls.__mro__[1:])):
        described |= _described(parent)  # type: ignore[arg-type]
    docstring = docstring_parser.parse(cls.__doc__ or "", DocstringStyle.GOOGLE)
    texts = {
        item.arg_name: " ".join((item.description or "").split())
        for item in docstring.params
        if item.args[0] == "attribute"
    }
    for name, kind in inspect.get_annotations(cls).items():
        described[name] = (kind, texts.get(name, ""))
    return described
