"""Results as one tidy table: a row a trial, a column a value, so that grouping, pivoting and joining are pandas'."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import typing
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import docstring_parser
import pandas as pd
from docstring_parser import DocstringStyle

from companion.engine.provenance import Provenance
from companion.engine.store import Outcome, Row
from companion.training import StudyTraining
from companion.trials import Trial
from sidm.body import Body
from sidm.config import to_mapping
from sidm.settings import Network

# Parts of a row -> what stands before their columns' names.
_PARTS: tuple[tuple[type, str], ...] = (
    (Trial, ""),
    (Network, ""),
    (StudyTraining, ""),
    (StudyTraining, "pretraining_"),
    (Outcome, ""),
    (Provenance, ""),
)


def frame_of(rows: Iterable[Row]) -> pd.DataFrame:
    """Rows as a table, by the key of their trial.

    Values of the trial, its network, training, outcome and provenance are columns of
    their own names; those of a pretraining have ``pretraining_`` before them and are
    missing where there is none. `columns` says what each is, with its unit. Curves and
    paths are tuples in a cell. `stale` tells what older code made.
    """
    rows = list(rows)
    names = [name for name, _, _ in columns()]
    lines = [_line(row) for row in rows]
    return pd.DataFrame(
        lines,
        columns=names,
        index=pd.Index([row.trial.key for row in rows], name="key"),
    )


def columns() -> list[tuple[str, str, str]]:
    """Name, type and description, with its unit, of every column of `frame_of`."""
    found = [
        (f"{prefix}{name}", kind, words)
        for cls, prefix in _PARTS
        for name, (kind, words) in _described(cls).items()
        if name
        not in (
            "network",
            "training",
            "pretraining",
        )  # whose values are columns themselves
    ]
    return [
        *found,
        ("stale", "bool", "whether today's code would come to other figures"),
    ]


def _line(row: Row) -> dict[str, Any]:
    trial = to_mapping(row.trial)
    parts = _flat(trial | trial["network"] | trial["training"])
    return (
        parts
        | to_mapping(row.outcome)
        | to_mapping(row.provenance)
        | {"stale": row.provenance.stale}
    )


def numbers_and_words(frame: pd.DataFrame) -> pd.DataFrame:
    """The columns of a table that have one value in a cell, for files such as CSV."""
    return frame.loc[
        :, [bool(frame[name].map(pd.api.types.is_scalar).all()) for name in frame]
    ]


def records_frame(kind: type, found: Iterable[Any]) -> pd.DataFrame:
    """Records of one kind as a table, a row a record: what it is about, what was found, what made it.

    Values of what a record is about are columns of their own names; those of its parts,
    such as a trial, have the part's name before them (``trial_seed``), and are missing
    where there is no such part. What was found under a name that the provenance has too
    is a column with ``found_`` before it (``found_seconds``).
    """
    about, made_by = typing.get_type_hints(kind)["about"], list(_names(Provenance))
    fields = [
        field.name
        for field in dataclasses.fields(kind)
        if field.name not in ("about", "provenance")
    ]
    own = {name: f"found_{name}" if name in made_by else name for name in fields}
    lines = []
    for one in found:
        values = {column: getattr(one, name) for name, column in own.items()}
        made = to_mapping(one.provenance) | {"stale": one.provenance.stale}
        lines.append(_flat(to_mapping(one.about)) | values | made)
    return pd.DataFrame(
        lines, columns=[*_names(about), *own.values(), *made_by, "stale"]
    )


def of_trials(frame: pd.DataFrame) -> pd.DataFrame:
    """Records that are about trials, with the trials' columns by their own names, ``seed`` for ``trial_seed``."""
    own = {
        name: name.removeprefix("trial_")
        for name in frame
        if name.removeprefix("trial_") not in frame
    }
    return frame.rename(columns=own)


def _names(cls: type, prefix: str = "") -> Iterator[str]:
    """Columns of a `config` class's values, those of its parts with the part's name before them."""
    hints = typing.get_type_hints(cls)
    for field in dataclasses.fields(cls):
        hint = hints[field.name]
        part = next(
            (
                one
                for one in (hint, *typing.get_args(hint))
                if dataclasses.is_dataclass(one)
            ),
            None,
        )
        name = f"{prefix}{field.name}"
        if part in (None, Body) or typing.get_origin(hint) is tuple:
            yield name
        else:
            yield from _names(part, f"{name}_")  # type: ignore[arg-type]


def _flat(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in values.items():
        if name.endswith("_body") and isinstance(value, Mapping):
            value = value["name"]
        found |= (
            _flat(value, f"{prefix}{name}_")
            if isinstance(value, Mapping)
            else {f"{prefix}{name}": value}
        )
    return found


@functools.cache
def _described(cls: type) -> dict[str, tuple[str, str]]:
    """Field -> its type, and what the Attributes of the class's docstring say of it."""
    parents = [
        base for base in reversed(cls.__mro__[1:]) if dataclasses.is_dataclass(base)
    ]
    described: dict[str, tuple[str, str]] = {}
    for parent in parents:
        described |= _described(parent)
    words = {
        item.arg_name: item.description or ""
        for item in docstring_parser.parse(
            cls.__doc__ or "", DocstringStyle.GOOGLE
        ).params
        if item.args[0] == "attribute"
    }
    for name, kind in inspect.get_annotations(cls).items():
        described[name] = (kind, " ".join(words.get(name, "").split()))
    return described
