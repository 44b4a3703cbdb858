"""Frozen dataclasses for configuration that refuse unknown names and wrong types.

The error names the parameter and, for an unknown name, the nearest known one.
"""

from __future__ import annotations

import contextlib
import dataclasses
import difflib
import functools
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar, dataclass_transform

T = TypeVar("T")

LARGEST = 1e12  # no size, rate or seed is larger


class ConfigError(ValueError):
    """An unknown parameter or a wrong value; the message is one line for its user."""


class Notice(UserWarning):
    """What a user should know although nothing failed; the message is one line."""


class DataError(ValueError):
    """A fault in a file of data; one line that names file, fault and remedy."""


def first_line(error: object) -> str:
    """The first line of an error's message, or the error's type if it has none."""
    return (str(error).splitlines() or [type(error).__name__])[0]


def counted(number: int, what: str) -> str:
    """A number of things: '1 drive', '2 drives'."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def hint(name: str, known: Iterable[str]) -> str:
    """A text with the nearest of the `known` names, or all of them if none is near."""
    known = list(known)
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    comma = "; " if any("," in one for one in known) else ", "
    return f"did you mean '{near[0]}'?" if near else f"known: {comma.join(known)}"


def unknown_name(
    name: str, known: Iterable[str], where: str = "", kind: str = "name"
) -> ConfigError:
    """The error for a name of a `kind`, as 'method', not known at the place `where`."""
    place = f" in {where}" if where else ""
    return ConfigError(f"unknown {kind} {name!r}{place}; {hint(name, known)}")


def no_such_file(path: str | Path) -> str:
    """A text for a path that is not there, with the nearest name beside it."""
    path = Path(path)
    beside = [*map(str, path.parent.iterdir())] if path.parent.is_dir() else []
    near = difflib.get_close_matches(str(path), beside, n=1, cutoff=0.8)
    question = f"; did you mean '{near[0]}'?" if near else ""
    return f"{path}: there is no such file{question}"


def conform(value: Any, kind: Any, name: str) -> Any:
    """A value of a type (an int may be a float, a list a tuple), or ConfigError."""
    if kind is Any or type(value) is kind:
        return value
    origin, arguments = _parts(kind)
    if origin in (typing.Union, types.UnionType):
        for option in arguments:
            with contextlib.suppress(ConfigError):
                return conform(value, option, name)
    elif origin is typing.Literal:
        if value in arguments:
            return value
        options = ", ".join(map(repr, arguments))
        near = hint(str(value), map(str, arguments))
        raise ConfigError(f"'{name}' must be one of {options}, not {value!r}; {near}")
    elif origin in (tuple, list) and isinstance(value, (list, tuple)):
        any_length = origin is list or arguments[1:] == (Ellipsis,)
        # curves are long: what needs no conversion is not looked at one by one
        if any_length and set(map(type, value)) <= {arguments[0]}:
            return origin(value)
        kinds = arguments[:1] * len(value) if any_length else arguments
        if len(kinds) == len(value):
            return origin(map(conform, value, kinds, [name] * len(value)))
    elif kind in (float, int):
        numbers = (int, float) if kind is float else int
        if isinstance(value, numbers) and not isinstance(value, bool):
            return kind(value)
    elif isinstance(kind, type) and isinstance(value, kind):
        return value
    wanted = kind.__name__ if isinstance(kind, type) else str(kind)
    given = f"{type(value).__name__} ({value!r})"
    raise ConfigError(f"'{name}' must be {wanted}, not {given}")


@functools.cache
def _parts(kind: Any) -> tuple[Any, tuple]:
    """Origin and arguments of a type; cached, since many values have few types."""
    return typing.get_origin(kind), typing.get_args(kind)


@dataclass_transform(kw_only_default=True, frozen_default=True)
def config(cls: type[T]) -> type[T]:
    """A frozen, keyword-only dataclass that refuses unknown names and wrong types."""
    made = dataclasses.dataclass(frozen=True, kw_only=True)(cls)
    plain: Callable[..., None] = made.__init__

    @functools.wraps(plain)
    def __init__(self: Any, **values: Any) -> None:
        kinds = _kinds(made)  # type: ignore[arg-type]
        for name in values:
            if name not in kinds:
                raise unknown_name(name, kinds, made.__name__)
        for name, value in values.items():
            # Most values are of their type. The test here saves a call for each of the
            # thousands that are read from files.
            if type(value) is not kinds[name]:
                values[name] = conform(value, kinds[name], f"{made.__name__}.{name}")
        plain(self, **values)

    made.__init__ = __init__  # type: ignore[method-assign]
    return made


@functools.cache
def _kinds(cls: type) -> dict[str, Any]:
    """Field -> type of a `config` class; cached: to resolve annotations is slow."""
    kinds = typing.get_type_hints(cls)
    return {field.name: kinds[field.name] for field in dataclasses.fields(cls)}


@functools.cache
def _nested(cls: type) -> dict[str, type]:
    """Field -> the `config` class that it holds; `Nested | None` counts as `Nested`."""
    nested = {}
    for name, kind in _kinds(cls).items():
        for option in (kind, *typing.get_args(kind)):
            if isinstance(option, type) and dataclasses.is_dataclass(option):
                nested[name] = option
    return nested


def _as_tuple(value: Any) -> tuple:
    """The value itself if it is a tuple, else a tuple of it alone."""
    return value if isinstance(value, tuple) else (value,)


def check_numbers(settings: Any) -> None:
    """Check that every number of a configuration is finite and of a possible size."""
    for name, value in vars(settings).items():
        for number in _as_tuple(value):
            if isinstance(number, (int, float)) and not abs(number) <= LARGEST:
                where = f"{type(settings).__name__}.{name}"
                limits = f"from -{LARGEST:g} to {LARGEST:g}"
                raise ConfigError(f"{where} must be a number {limits}, not {number}")


def check_at_least(settings: Any, least: float, *names: str) -> None:
    """Check that fields, numbers or tuples of numbers, are at least `least`."""
    for name in names:
        value = getattr(settings, name)
        if min(_as_tuple(value)) < least:
            where = f"{type(settings).__name__}.{name}"
            raise ConfigError(f"{where} must be at least {least}, not {value}")


def replace(settings: T, **changes: Any) -> T:
    """A copy of a configuration with changed values, checked like a new one."""
    return dataclasses.replace(settings, **changes)  # type: ignore[type-var]


def from_mapping(cls: type[T], values: Mapping[str, Any]) -> T:
    """A `config` class from a mapping, as YAML gives it; nested classes likewise."""
    nested = _nested(cls)  # type: ignore[arg-type]
    ready = {
        name: from_mapping(nested[name], value)
        if name in nested and isinstance(value, Mapping)
        else value
        for name, value in values.items()
    }
    return cls(**ready)


def to_mapping(settings: Any) -> dict[str, Any]:
    """What `dataclasses.asdict` gives, without copies; `from_mapping` reads it."""
    cls: Any = type(settings)
    values = {name: getattr(settings, name) for name in _kinds(cls)}
    for name in _nested(cls):
        if values[name] is not None:
            values[name] = to_mapping(values[name])
    return values


def completed(cls: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """Stored values with the defaults of fields that they lack, nested ones likewise.

    They are what `to_mapping(from_mapping(cls, values))` gives, unchecked and with
    lists for tuples, in a tenth of the time. ConfigError names a field that is not
    known, or that is missing and has no default.
    """
    kinds, nested, defaults = _kinds(cls), _nested(cls), _defaults(cls)  # type: ignore[arg-type]
    for name in values.keys() - kinds.keys():
        raise unknown_name(name, kinds, cls.__name__)
    for name in kinds.keys() - defaults.keys() - values.keys():
        raise ConfigError(f"{cls.__name__}.{name} is missing")
    return defaults | {
        name: completed(nested[name], value)
        if isinstance(value, dict) and name in nested
        else value
        for name, value in values.items()
    }


@functools.cache
def _defaults(cls: type) -> dict[str, Any]:
    """Field -> its default, as `to_mapping` gives it."""
    defaults = {}
    for field in dataclasses.fields(cls):
        value = field.default
        if field.default_factory is not dataclasses.MISSING:
            value = field.default_factory()
        if value is not dataclasses.MISSING:
            holds = field.name in _nested(cls) and value is not None  # type: ignore[arg-type]
            defaults[field.name] = to_mapping(value) if holds else value
    return defaults
