"""A body in a YAML file, or in a mapping with the same keys."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sidm.body import SI, Body, units_like
from sidm.config import ConfigError, no_such_file, replace, unknown_name


def read_body(path: str | Path) -> Body:
    """Read a body from a YAML file with the fields of `Body`.

    Columns and actions are written as `name: unit`, map and rate with their units.
    """
    import yaml  # here, since commands that only list trials need no YAML

    try:
        with open(path, encoding="utf-8") as file:
            values = yaml.load(file, _strict_loader())
        if not isinstance(values, dict):
            raise ConfigError("a body is lines of 'name: value'")
        return body_from_mapping(values, Path(path).stem)
    except FileNotFoundError:
        raise ConfigError(no_such_file(path)) from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read ({error})") from None
    except yaml.YAMLError as error:
        text = " ".join(str(error).split())
        quote = "; write a unit of % as '%'" if "'%'" in text else ""
        raise ConfigError(f"{path}: no YAML ({text}){quote}") from None
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def _strict_loader() -> Any:
    """The safe YAML loader, but one that refuses a key that is given twice."""
    import yaml

    class Loader(yaml.SafeLoader):
        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            names: list[Any] = []
            for key, _ in node.value:
                name = self.construct_object(key, deep=True)
                if name in names:
                    raise ConfigError(
                        f"line {key.start_mark.line + 1}: '{name}' is given twice; "
                        "leave one out"
                    )
                names.append(name)
            return super().construct_mapping(node, deep)

    return Loader


def as_body(body: Body | str | Path | Mapping[str, Any]) -> Body:
    """The body that the argument is, or that a YAML file or a mapping describes."""
    if isinstance(body, Body):
        return body
    if isinstance(body, (str, Path)):
        return read_body(body)
    if isinstance(body, Mapping):
        return body_from_mapping(body, "robot")
    kind = type(body).__name__
    raise TypeError(f"a body is a sidm.Body, a YAML file or a mapping, not {kind}")


NUMBER_AND_UNIT = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)"
#: Keys of a body's file; `map` stands for the fields `map_size` and `map_pixels`.
KEYS = "name pose tilt columns actions map rate weights resolution".split()
MAP = ("size", "pixels")


def body_from_mapping(values: Mapping[str, Any], name: str) -> Body:
    """The body that a mapping describes, with the keys and values of a body's file.

    A number with a unit may be a text. `name` is the body's if the mapping has none.
    """
    for key in values:
        if key not in KEYS:
            raise unknown_name(str(key), KEYS, "a body", "key")
    if "actions" not in values:
        raise ConfigError(
            "it has no actions; name at least one command that drives it, "
            "as 'actions: {throttle: 1}'"
        )
    plain = ("name", "pose", "tilt", "weights")
    fields = {"name": name} | {key: values[key] for key in plain if key in values}
    for key in ("columns", "actions"):
        units = values.get(key) or {}
        if not isinstance(units, dict):
            raise ConfigError(f"{key} are lines of 'name: unit', not {units!r}")
        fields[key] = tuple(
            (str(column), "" if unit is None else str(unit))
            for column, unit in units.items()
        )
    if "rate" in values:
        fields["rate"] = _quantity(values["rate"], "Hz", "rate")
    ground = values.get("map", "none")
    if ground not in ("none", None):
        if not isinstance(ground, dict) or not {"size"} <= {*ground} <= {*MAP}:
            raise ConfigError(
                f"map is 'none' or '{{size: 5 m, pixels: 32}}', not {ground!r}"
            )
        fields["map_size"] = _quantity(ground["size"], "m", "map size")
        fields["map_pixels"] = ground.get("pixels", 0)
    body = Body(**fields)
    if "resolution" in values:
        body = replace(body, resolution=_resolution(values["resolution"], body))
    return body


def _resolution(values: Any, body: Body) -> tuple[tuple[str, float], ...]:
    """Names of components of y and their resolutions in SI units."""
    resolutions, units = [], dict(body.changes)
    if not isinstance(values, dict):
        raise ConfigError(
            f"resolution is lines of 'name: value unit', as 'left: 1 mm', "
            f"not {values!r}"
        )
    for name, value in values.items():
        if name not in units:
            raise unknown_name(str(name), units, "resolution", "component")
        known = units_like(units[name])
        match = re.fullmatch(NUMBER_AND_UNIT, str(value).strip())
        if not match or (match[2] or "1") not in known:
            raise ConfigError(
                f"the resolution of '{name}' is a number in {' or '.join(known)}, "
                f"not {value!r}"
            )
        resolutions.append((name, float(match[1]) * known[match[2] or "1"]))
    return tuple(resolutions)


def _quantity(value: Any, unit: str, name: str) -> float:
    """The number of a value that may end with its unit."""
    try:
        return float(str(value).strip().removesuffix(unit))
    except ValueError:
        raise ConfigError(f"{name} is a number in {unit}, not {value!r}") from None


def body_to_mapping(body: Body) -> dict[str, Any]:
    """The mapping that `body_from_mapping` reads as the same body."""
    values: dict[str, Any] = {"name": body.name, "pose": body.pose, "tilt": body.tilt}
    values |= {key: dict(getattr(body, key)) for key in ("columns", "actions")}
    if body.map_size:
        pixels = {"pixels": body.map_pixels} if body.map_pixels else {}
        values["map"] = {"size": f"{body.map_size} m"} | pixels
    values |= {"rate": f"{body.rate} Hz", "weights": body.weights}
    if body.resolution:
        units = dict(body.changes)
        values["resolution"] = {
            name: f"{value!r} {SI[units[name]]}" for name, value in body.resolution
        }
    return values
