"""Strict frozen configuration: a dataclass that refuses unknown names and wrong types, naming the nearest right one."""

from __future__ import annotations

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


def unknown_name(name: str, known: Iterable[str], where: str) -> ConfigError:
    """The error for `name`, which `where` does not know, with the nearest of the `known` names."""
    known = list(known)
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}"
    return ConfigError(f"unknown parameter '{name}' of {where}; {hint}")


def conform(value: Any, kind: Any, name: str) -> Any:
    """`value` as the type `kind` asks for it (an int serves as float, a list as tuple); ConfigError for others."""
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
        near = difflib.get_close_matches(str(value), [str(a) for a in arguments], n=1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        raise ConfigError(f"'{name}' must be one of {', '.join(map(repr, arguments))}, not {value!r}{hint}")
    elif origin is tuple:
        if isinstance(value, (list, tuple)):
            if len(arguments) == 2 and arguments[1] is Ellipsis:
                return tuple(conform(item, arguments[0], name) for item in value)
            if len(arguments) == len(value):
                return tuple(conform(item, part, name) for item, part in zip(value, arguments, strict=True))
    elif kind is float:
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return float(value)
    elif kind is int:
        if isinstance(value, int) and not isinstance(value, bool):
            return value
    elif isinstance(kind, type) and isinstance(value, kind):
        return value
    shown = kind.__name__ if isinstance(kind, type) else str(kind)
    raise ConfigError(f"'{name}' must be {shown}, not {type(value).__name__} ({value!r})")


@dataclass_transform(kw_only_default=True, frozen_default=True)
def config(cls: type[T]) -> type[T]:
    """Class decorator: a frozen, keyword-only dataclass; ConfigError for an unknown name or a wrong type."""
    made = dataclasses.dataclass(frozen=True, kw_only=True)(cls)
    plain: Callable[..., None] = made.__init__

    @functools.wraps(plain)
    def __init__(self: Any, **values: Any) -> None:
        fields = {field.name: field for field in dataclasses.fields(made)}  # type: ignore[arg-type]
        kinds = typing.get_type_hints(made)
        for name in values:
            if name not in fields:
                raise unknown_name(name, fields, made.__name__)
        plain(self, **{name: conform(value, kinds[name], f"{made.__name__}.{name}") for name, value in values.items()})

    made.__init__ = __init__  # type: ignore[method-assign]
    return made


def refuse_nonsense(settings: Any) -> None:
    """ConfigError naming the first number of a configuration that is not finite or too large to be meant."""
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name)
        for one in value if isinstance(value, tuple) else (value,):
            if isinstance(one, (int, float)) and not abs(one) <= LARGEST:
                name = f"{type(settings).__name__}.{field.name}"
                raise ConfigError(f"{name} must be a number from -{LARGEST:g} to {LARGEST:g}, not {one}")


def from_mapping(cls: type[T], values: Mapping[str, Any]) -> T:
    """An instance of a `config` class from a mapping (as read from YAML), nested classes from nested mappings."""
    kinds = typing.get_type_hints(cls)
    ready = {}
    for name, value in values.items():
        options = kinds.get(name), *typing.get_args(kinds.get(name))  # of `Nested | None` too
        nested = [kind for kind in options if isinstance(kind, type) and dataclasses.is_dataclass(kind)]
        ready[name] = from_mapping(nested[0], value) if nested and isinstance(value, Mapping) else value
    return cls(**ready)
