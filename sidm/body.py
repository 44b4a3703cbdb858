"""Numbers of a robot's state, action, map and transition: the paper's spaces X and Y.

A state is the pose and then the body's columns. x (section 3) is the up direction where
the pose gives it and the body asks for it, the columns and the actions, beside a height
map. y is the change of the pose, in the robot's own frame, and the next columns.

=======  =======================================  ======================================
pose     in the state                             in y
=======  =======================================  ======================================
none     nothing                                  nothing
planar   x, y in m, yaw in rad                    forward and left in m, turn in rad
spatial  x, y, z in m, quaternion qx, qy, qz, qw  translation in m, quaternion with
                                                  w >= 0
=======  =======================================  ======================================
"""

from __future__ import annotations

import math
import re
from typing import Literal

from sidm.config import LARGEST, ConfigError, check_numbers, config, unknown_name

#: Kind of quantity -> unit -> the unit's size in the SI unit, which stands first.
UNITS = {
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "km/h": 1 / 3.6},
    "acceleration": {"m/s2": 1.0},
    "angle": {"rad": 1.0, "deg": math.pi / 180},
    "angular velocity": {
        "rad/s": 1.0,
        "deg/s": math.pi / 180,
        "rpm": math.pi / 30,
    },
    "number": {"1": 1.0, "%": 1e-2},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "current": {"A": 1.0},
    "voltage": {"V": 1.0},
    "force": {"N": 1.0},
    "torque": {"N m": 1.0, "Nm": 1.0, "N*m": 1.0},
    "power": {"W": 1.0},
    "temperature": {"degC": 1.0},  # kept in degC, since differences are those in K
}


class _SIUnits(dict[str, str]):
    def __missing__(self, unit: str) -> str:
        return unit


#: Unit -> the SI unit of the same kind of quantity; an unknown unit -> itself.
SI = _SIUnits({unit: next(iter(units)) for units in UNITS.values() for unit in units})

#: Kind of quantity -> the smallest change that its sensor resolves, in the SI unit,
#: where a body's file does not say it; 0 for the other kinds.
RESOLUTIONS = {
    "length": 1e-4,
    "velocity": 1e-3,
    "acceleration": 1e-3,
    "angle": 1e-4,
    "angular velocity": 1e-3,
    "number": 1e-6,
}


def kind_of(unit: str) -> str:
    """The kind of quantity that a unit measures, a key of `UNITS`; '' if unknown."""
    return next((kind for kind, units in UNITS.items() if unit in units), "")


def units_like(unit: str) -> dict[str, float]:
    """Units of the same kind and their sizes in the SI unit; unknown ones are alone."""
    return UNITS.get(kind_of(unit), {unit: 1.0})


Pose = Literal["none", "planar", "spatial"]
Columns = tuple[tuple[str, str], ...]  # names and units


def _columns(unit: str, *names: str) -> Columns:
    """Columns of these names, all in one unit."""
    return tuple((name, unit) for name in names)


#: Pose -> names and units of its numbers in the state.
POSES: dict[str, Columns] = {
    "none": (),
    "planar": (*_columns("m", "x", "y"), ("yaw", "rad")),
    "spatial": _columns("m", "x", "y", "z") + _columns("1", "qx", "qy", "qz", "qw"),
}

#: Pose -> names and units of its change in y.
CHANGES: dict[str, Columns] = {
    "none": (),
    "planar": (*_columns("m", "forward", "left"), ("turn", "rad")),
    "spatial": _columns("m", "forward", "left", "up")
    + _columns("1", *(f"rotation {axis}" for axis in "xyzw")),
}

#: Names of the up direction in x.
UP = ("up x", "up y", "up z")


@config
class Body:
    """The numbers of one robot's state and action: X and Y of section 3.

    Attributes:
        name: for messages
        pose: 'none'; 'planar': x, y, yaw; 'spatial': x, y, z, quaternion
        tilt: whether the network's input has the up direction in the robot's frame;
            spatial poses only
        columns: names and units of the state's other numbers, such as velocities or
            wheel speeds
        actions: names and units of the commands
        map_size: side of the robot-centred height map, m; 0: no map
        map_pixels: pixels along a side of the map; 0: as many as `Network.pixels`
        rate: control steps a second, Hz
        weights: factor of each component in equation (1): 'ones', or 'variance': 1 /
            the component's variance in the training data; a trial's results have the
            variance in the validation set
        resolution: names of components of y and the smallest change that the sensor of
            each resolves, in SI units; others have that of their kind in `RESOLUTIONS`

    Examples:
        >>> cart = sidm.Body(
        ...     name="cart",
        ...     pose="planar",
        ...     columns=(("speed", "m/s"),),
        ...     actions=(("throttle", "1"),),
        ... )
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
    resolution: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        """Refuse values that describe no robot, with an error that names the fault."""
        check_numbers(self)
        if fault := self._fault():
            raise ConfigError(f"body '{self.name}': {fault}")

    def _fault(self) -> str:
        """The first fault of the body; an empty text when there is none."""
        for column, unit in (*self.columns, *self.actions):
            if not re.fullmatch(r"[A-Za-z_]\w*", column):
                return f"a column's name is letters, digits and _, not '{column}'"
            if not re.fullmatch(r"[^\s\[\]](?:[^\[\]]*[^\s\[\]])?", unit):
                return f"'{column}' has no unit; write '1' for a plain number"
        names = [name for name, _ in (*self.state, *self.actions)]
        for name in names:
            if names.count(name) > 1:
                return f"two columns '{name}'"
        for change in CHANGES[self.pose]:
            if change in dict(self.columns):
                return (
                    f"'{change}' is a component of the motion; call the column "
                    f"otherwise, as 'wheel_{change}'"
                )
        if not self.actions:
            return "it has no actions; name at least one command that drives it"
        if not self.state:
            return "nothing to predict; give it a pose or columns"
        if self.tilt and self.pose != "spatial":
            return f"tilt is seen in a spatial pose alone, not in pose: {self.pose}"
        pixels_alone = self.map_pixels and not self.map_size
        if self.map_size < 0 or self.map_pixels < 0 or pixels_alone:
            return f"a map of {self.map_pixels} pixels on {self.map_size:g} m"
        if self.map_size and self.pose == "none":
            return "a height map needs a pose"
        if not self.rate > 0:
            return f"rate must be positive, not {self.rate:g} Hz"
        given = [name for name, _ in self.resolution]
        for name, value in self.resolution:
            if name not in self.targets:
                return str(unknown_name(name, self.targets, "resolution", "component"))
            if given.count(name) > 1:
                return f"two resolutions of '{name}'"
            if not 0 <= value <= LARGEST:
                return (
                    f"the resolution of '{name}' must be from 0 to {LARGEST:g}, "
                    f"not {value:g}"
                )
        return ""

    @property
    def unknown_units(self) -> dict[str, str]:
        """Name of each column with a unit that is not in `UNITS` -> that unit."""
        columns = (*self.columns, *self.actions)
        return {name: unit for name, unit in columns if unit not in SI}

    @property
    def state(self) -> Columns:
        """Names and units of the S numbers of a state."""
        return (*POSES[self.pose], *self.columns)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the X numbers of x, without the height map."""
        up = UP if self.tilt else ()
        return (*up, *(name for name, _ in (*self.columns, *self.actions)))

    @property
    def targets(self) -> tuple[str, ...]:
        """Names of the Y components of y."""
        return tuple(name for name, _ in self.changes)

    @property
    def changes(self) -> Columns:
        """Names and units of the Y components of y."""
        return (*CHANGES[self.pose], *self.columns)

    @property
    def resolutions(self) -> tuple[float, ...]:
        """The smallest change (Y,) that is measured in each component, in SI units."""
        given = dict(self.resolution)
        return tuple(
            given.get(name, RESOLUTIONS.get(kind_of(unit), 0.0))
            for name, unit in self.changes
        )

    @property
    def pose_size(self) -> int:
        """How many numbers the pose has in the state; its change in y has as many."""
        return len(POSES[self.pose])

    def pixels(self, default: int) -> int:
        """Pixels along a side of the height map, by default the network's."""
        return (self.map_pixels or default) if self.map_size else 0


TWIST = _columns("m/s", "vx", "vy", "vz") + _columns("rad/s", "wx", "wy", "wz")
DRIVE = _columns("1", "throttle", "steering")

#: Body of the paper's robots (section 4): 11 numbers in x, a map of 5 m, 13 in y.
ROVER = Body(
    name="rover", tilt=True, columns=TWIST, actions=DRIVE, map_size=5.0, weights="ones"
)
