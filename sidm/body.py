"""What a robot's state, action, map and transition are made of: the spaces X and Y of the paper (section 3).

A state is the pose and then the columns; x is the up direction where the pose gives it
and the body has it, the columns and the actions, beside a height map; y is the change
of the pose, in the body's own frame, and the next columns.

=========  ===============================================
========================================================== pose       in the state                                     in y
=========  ===============================================
========================================================== none       nothing                                          nothing
planar     x, y in m, yaw in rad                            forward and left in m, turn in rad
spatial    x, y, z in m, quaternion qx, qy, qz, qw          translation in m, rotation as a quaternion with w >= 0
=========  ===============================================
==========================================================
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from sidm.config import ConfigError, config, refuse_nonsense, unknown_name

#: Kind of quantity -> unit -> what it is in the SI's.
UNITS = {
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "km/h": 1 / 3.6},
    "acceleration": {"m/s2": 1.0},
    "angle": {"rad": 1.0, "deg": math.pi / 180},
    "angular velocity": {"rad/s": 1.0, "deg/s": math.pi / 180},
    "number": {"1": 1.0},
    "time": {"s": 1.0, "ms": 1e-3},
}

#: unit -> the SI's of its kind
SI = {unit: next(iter(units)) for units in UNITS.values() for unit in units}

Pose = Literal["none", "planar", "spatial"]
POSES: dict[
    str, tuple[tuple[str, str], ...]
] = {  # names and units of a pose in the state
    "none": (),
    "planar": (("x", "m"), ("y", "m"), ("yaw", "rad")),
    "spatial": (
        ("x", "m"),
        ("y", "m"),
        ("z", "m"),
        ("qx", "1"),
        ("qy", "1"),
        ("qz", "1"),
        ("qw", "1"),
    ),
}
CHANGES: dict[str, tuple[str, ...]] = {  # what a pose's change is called in y
    "none": (),
    "planar": ("forward", "left", "turn"),
    "spatial": (
        "forward",
        "left",
        "up",
        "rotation x",
        "rotation y",
        "rotation z",
        "rotation w",
    ),
}
UP = ("up x", "up y", "up z")

Columns = tuple[tuple[str, str], ...]  # name and unit


@config
class Body:
    """The make-up of one robot's data: what a state and an action are, X and Y of section 3.

    Attributes:
        tilt: whether x has the up direction in the body's frame, of a spatial pose
        columns: of the state beside the pose, such as velocities or wheel speeds
        map_size: side of the robot-centred height map, m; 0: none
        map_pixels: a side of it; 0: as many as `Network.pixels`
        rate: control steps a second, Hz
        weights: of y's components in equation (1): 1, or 1 over the variance in the
            system's own motion that it learns from, or that a trial judges by

    Raises:
        ConfigError: an unknown name, a wrong type, or a unit that is not known.

    Examples:
        >>> cart = sidm.Body(name="cart", pose="planar", columns=(("speed", "m/s"),), actions=(("throttle", "1"),))
        >>> cart.targets
        ('forward', 'left', 'turn', 'speed')
    """

    name: str
    pose: Pose = "spatial"
    tilt: bool = False
    columns: Columns
    actions: Columns
    map_size: float = 0.0
    map_pixels: int = 0
    rate: float = 10.0
    weights: Literal["ones", "variance"] = "variance"

    def __post_init__(self) -> None:
        """Refuse what is no body, naming the fault."""
        refuse_nonsense(self)
        for column, unit in (*self.columns, *self.actions):
            if not re.fullmatch(r"[A-Za-z_]\w*", column):
                raise ConfigError(
                    f"body '{self.name}': a column's name is letters, digits and _, not '{column}'"
                )
            if unit not in SI:
                known = ", ".join(SI)
                raise ConfigError(
                    f"body '{self.name}': '{column}' in '{unit}'; the units are {known}"
                )
        names = [name for name, _ in (*self.state, *self.actions)]
        for name in names:
            if names.count(name) > 1:
                raise ConfigError(f"body '{self.name}': two columns '{name}'")
        if not self.actions:
            raise ConfigError(
                f"body '{self.name}': it has no actions; name at least one command that drives it"
            )
        if not self.state:
            raise ConfigError(
                f"body '{self.name}': nothing to predict; give it a pose or columns"
            )
        if self.tilt and self.pose != "spatial":
            raise ConfigError(
                f"body '{self.name}': tilt is seen in a spatial pose alone, not in pose: {self.pose}"
            )
        if (
            self.map_size < 0
            or self.map_pixels < 0
            or self.map_size == 0 < self.map_pixels
        ):
            raise ConfigError(
                f"body '{self.name}': a map of {self.map_pixels} pixels on {self.map_size:g} m"
            )
        if self.map_size and self.pose == "none":
            raise ConfigError(f"body '{self.name}': a height map needs a pose")
        if not self.rate > 0:
            raise ConfigError(
                f"body '{self.name}': rate must be positive, not {self.rate:g} Hz"
            )

    @property
    def state(self) -> Columns:
        """All of a state, (S,)."""
        return (*POSES[self.pose], *self.columns)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The numbers of x, (X,)."""
        return (
            *(UP if self.tilt else ()),
            *(name for name, _ in (*self.columns, *self.actions)),
        )

    @property
    def targets(self) -> tuple[str, ...]:
        """The components of y, (Y,)."""
        return (*CHANGES[self.pose], *(name for name, _ in self.columns))

    @property
    def pose_size(self) -> int:
        """Numbers of the pose in the state, as many as in y."""
        return len(POSES[self.pose])

    def pixels(self, default: int) -> int:
        """A side of the height map, where the network's are `default`; 0 without one."""
        return (self.map_pixels or default) if self.map_size else 0


TWIST = (
    ("vx", "m/s"),
    ("vy", "m/s"),
    ("vz", "m/s"),
    ("wx", "rad/s"),
    ("wy", "rad/s"),
    ("wz", "rad/s"),
)
DRIVE = (("throttle", "1"), ("steering", "1"))

#: The paper's (section 4): x of 11 numbers and a map of 5 m, y of 13.
ROVER = Body(
    name="rover", tilt=True, columns=TWIST, actions=DRIVE, map_size=5.0, weights="ones"
)


def read_body(path: str | Path) -> Body:
    """The body of a YAML file: the fields of `Body`, columns and actions as `name: unit`, map and rate with units.

    Raises:
        ConfigError: one line that names the file and what is wrong in it.
    """
    import yaml  # which listing trials does without

    try:
        with open(path, encoding="utf-8") as file:
            values = yaml.safe_load(file)
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read ({error})") from None
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: no YAML ({' '.join(str(error).split())})") from None
    if not isinstance(values, dict):
        raise ConfigError(f"{path}: a body is lines of 'name: value'")
    try:
        return body_from(values, Path(path).stem)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def as_body(body: Body | str | Path | Mapping[str, Any]) -> Body:
    """A body from what stands for it: itself, the YAML file that describes it, or the mapping in such a file.

    Raises:
        ConfigError: the file or the mapping has a fault; one line.
        TypeError: something else.
    """
    if isinstance(body, Body):
        return body
    if isinstance(body, (str, Path)):
        return read_body(body)
    if isinstance(body, Mapping):
        return body_from(body, "robot")
    raise TypeError(
        f"a body is a sidm.Body, a YAML file or a mapping, not {type(body).__name__}"
    )


#: Lines of a body's file that are written otherwise than the fields of `Body`.
KEYS = ("name", "pose", "tilt", "columns", "actions", "map", "rate", "weights")


def body_from(values: Mapping[str, Any], name: str) -> Body:
    """The body of a mapping as `read_body` reads it, named `name` where it does not say; ConfigError for others."""
    for key in values:
        if key not in KEYS:
            raise unknown_name(str(key), KEYS, "a body")
    if "actions" not in values:
        raise ConfigError(
            "it has no actions; name at least one command that drives it, as 'actions: {throttle: 1}'"
        )
    found = {"name": name} | {
        key: values[key] for key in ("name", "pose", "tilt", "weights") if key in values
    }
    for key in ("columns", "actions"):
        pairs = values.get(key) or {}
        if not isinstance(pairs, dict):
            raise ConfigError(f"{key} are lines of 'name: unit', not {pairs!r}")
        found[key] = tuple((str(column), str(unit)) for column, unit in pairs.items())
    if "rate" in values:
        found["rate"] = _quantity(values["rate"], "Hz", "rate")
    return Body(**found, **_map(values.get("map", "none")))


def _map(value: Any) -> dict[str, Any]:
    """`map_size` and `map_pixels` of 'none' or of a mapping with size and pixels."""
    if value in ("none", None):
        return {}
    if not isinstance(value, dict) or not {"size"} <= value.keys() <= {
        "size",
        "pixels",
    }:
        raise ConfigError(
            f"map is 'none' or '{{size: 5 m, pixels: 32}}', not {value!r}"
        )
    return {
        "map_size": _quantity(value["size"], "m", "map size"),
        "map_pixels": value.get("pixels", 0),
    }


def _quantity(value: Any, unit: str, name: str) -> float:
    try:
        return float(str(value).strip().removesuffix(unit))
    except ValueError:
        raise ConfigError(f"{name} is a number in {unit}, not {value!r}") from None


def body_lines(body: Body) -> dict[str, Any]:
    """What `body_from` takes again."""
    found: dict[str, Any] = {"name": body.name, "pose": body.pose, "tilt": body.tilt}
    found |= {key: dict(getattr(body, key)) for key in ("columns", "actions")}
    if body.map_size:
        pixels = {"pixels": body.map_pixels} if body.map_pixels else {}
        found["map"] = {"size": f"{body.map_size:g} m"} | pixels
    return found | {"rate": f"{body.rate:g} Hz", "weights": body.weights}
