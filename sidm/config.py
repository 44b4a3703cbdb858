"""Strict frozen configuration: a dataclass that refuses unknown names and wrong types, naming the nearest right one."""

from __future__ import annotations

import contextlib
import dataclasses
import difflib
import functools
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar, dataclass_transform

T = TypeVar("T")

LARGEST = 1e12  # no size, rate or seed is larger


class ConfigError(ValueError):
    """A parameter that does not exist or has the wrong type; the message is one line for the person who typed it."""


class Fault(ValueError):
    """What is wrong with a file of data; the message is one line that names file and fault, and the mend."""


def first_line(error: object) -> str:
    """Of what an error says, or the name of its kind where it says nothing."""
    return (str(error).splitlines() or [type(error).__name__])[0]


def hint(name: str, known: Iterable[str]) -> str:
    """The nearest of the `known` names, or all of them where none is near."""
    known = list(known)
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}"


def unknown_name(name: str, known: Iterable[str], where: str) -> ConfigError:
    """The error for `name`, which `where` does not know."""
    return ConfigError(f"unknown parameter {name!r} of {where}; {hint(name, known)}")


def conform(value: Any, kind: Any, name: str) -> Any:
    """`value` as the type `kind` asks for it (an int serves as float, a list as tuple); ConfigError for others."""
    if type(value) is kind:
        return value
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if kind is Any:
        return value
    if origin in (typing.Union, types.UnionType):
        for option in arguments:
            try:
                return conform(value, option, name)
            except ConfigError:
                continue
    elif origin is typing.Literal:
        if value in arguments:
            return value
        raise ConfigError(
            f"'{name}' must be one of {', '.join(map(repr, arguments))}, not {value!r}; "
            f"{hint(str(value), map(str, arguments))}"
        )
    elif origin is tuple:
        if isinstance(value, (list, tuple)):
            if len(arguments) == 2 and arguments[1] is Ellipsis:
                part = arguments[0]
                return tuple(
                    item if type(item) is part else conform(item, part, name)
                    for item in value
                )
            if len(arguments) == len(value):
                return tuple(
                    conform(item, part, name)
                    for item, part in zip(value, arguments, strict=True)
                )
    elif origin is list:
        if isinstance(value, (list, tuple)):
            return [conform(item, arguments[0], name) for item in value]
    elif origin is dict:
        if isinstance(value, dict):
            key, item = arguments
            return {
                conform(one, key, name): conform(other, item, name)
                for one, other in value.items()
            }
    elif kind is float:
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return float(value)
    elif kind is int:
        if isinstance(value, int) and not isinstance(value, bool):
            return value
    elif isinstance(kind, type) and isinstance(value, kind):
        return value
    shown = kind.__name__ if isinstance(kind, type) else str(kind)
    raise ConfigError(
        f"'{name}' must be {shown}, not {type(value).__name__} ({value!r})"
    )


@dataclass_transform(kw_only_default=True, frozen_default=True)
def config(cls: type[T]) -> type[T]:
    """Class decorator: a frozen, keyword-only dataclass; ConfigError for an unknown name or a wrong type."""
    made = dataclasses.dataclass(frozen=True, kw_only=True)(cls)
    plain: Callable[..., None] = made.__init__

    @functools.wraps(plain)
    def __init__(self: Any, **values: Any) -> None:
        kinds = _kinds(made)  # type: ignore[arg-type]
        for name in values:
            if name not in kinds:
                raise unknown_name(name, kinds, made.__name__)
        for name, value in values.items():
            # most are: thousands are read back from files
            if type(value) is not kinds[name]:
                values[name] = conform(value, kinds[name], f"{made.__name__}.{name}")
        plain(self, **values)

    made.__init__ = __init__  # type: ignore[method-assign]
    return made


@functools.cache
def _kinds(cls: type) -> dict[str, Any]:
    """Field -> type of a `config` class; found once, since resolving annotations takes longer than all the rest."""
    kinds = typing.get_type_hints(cls)
    return {field.name: kinds[field.name] for field in dataclasses.fields(cls)}


@functools.cache
def _nested(cls: type) -> dict[str, type]:
    """Field -> the `config` class that it holds, of `Nested | None` too."""
    options = (
        (name, option)
        for name, kind in _kinds(cls).items()
        for option in (kind, *typing.get_args(kind))
    )
    return {
        name: option
        for name, option in options
        if isinstance(option, type) and dataclasses.is_dataclass(option)
    }


def refuse_nonsense(settings: Any) -> None:
    """ConfigError naming the first number of a configuration that is not finite or too large to be meant."""
    for name, value in vars(settings).items():
        for one in value if isinstance(value, tuple) else (value,):
            if isinstance(one, (int, float)) and not abs(one) <= LARGEST:
                where = f"{type(settings).__name__}.{name}"
                raise ConfigError(
                    f"{where} must be a number from -{LARGEST:g} to {LARGEST:g}, not {one}"
                )


def refuse_below(settings: Any, least: float, *names: str) -> None:
    """ConfigError naming the first of some numbers of a configuration, or of tuples of them, that is below `least`."""
    for name in names:
        value = getattr(settings, name)
        if min(value if isinstance(value, tuple) else (value,)) < least:
            raise ConfigError(
                f"{type(settings).__name__}.{name} must be at least {least}, not {value}"
            )


def replace(settings: T, **changes: Any) -> T:
    """A copy of a configuration with some values changed, checked like a new one."""
    return dataclasses.replace(settings, **changes)  # type: ignore[type-var]


def from_mapping(cls: type[T], values: Mapping[str, Any]) -> T:
    """An instance of a `config` class from a mapping (as read from YAML), nested classes from nested mappings."""
    nested = _nested(cls)  # type: ignore[arg-type]
    ready = {
        name: from_mapping(nested[name], value)
        if name in nested and isinstance(value, Mapping)
        else value
        for name, value in values.items()
    }
    return cls(**ready)


def to_mapping(settings: Any) -> dict[str, Any]:
    """What `from_mapping` takes again; as `dataclasses.asdict`, without its copies, which nothing frozen needs."""
    cls: Any = type(settings)
    values, nested = (
        {name: getattr(settings, name) for name in _kinds(cls)},
        _nested(cls),
    )
    return {
        name: to_mapping(one) if name in nested and one is not None else one
        for name, one in values.items()
    }


def parsed(text: str, name: str) -> Any:
    """The value that a command line's `text` stands for, by YAML; ConfigError, with the value's name, for none."""
    import yaml

    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        raise ConfigError(f"'{name}' cannot be read as YAML: {text!r}") from None
    if isinstance(value, str):  # YAML 1.1 takes 1e-3 for text
        with contextlib.suppress(ValueError):
            return float(value)
    return value


def changes(texts: Iterable[str]) -> dict[str, Any]:
    """Values by name from texts such as 'seeds=5', as `--set` takes them; ConfigError for another form."""
    found: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise ConfigError(f"--set takes NAME=VALUE, not '{text}'")
        found[name] = parsed(value, f"--set {name}")
    return found
