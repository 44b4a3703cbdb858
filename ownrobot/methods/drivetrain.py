"""Which numbers of a body drive it: wheels, a twist or a steering, found by names.

A kinematic model needs two signals of a robot: left and right speed of the wheels,
forward speed and yaw rate, or speed and steering. A signal is the mean of the columns
that measure it; where no column does, it is the command.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

from sidm.body import SI, Body, Columns
from sidm.config import ConfigError

Model = Literal["differential_drive", "rotation_centres", "ackermann"]

SPEEDS = "speed velocity forward_speed linear_velocity linear linear_x vx v".split()
YAW_RATES = (
    "yaw_rate turn_rate angular_velocity angular angular_z wz gyro_z omega w".split()
)
THROTTLES = ["throttle", "accelerator", "gas"]
STEERINGS = ["steering", "steer", "steering_angle", "steer_angle", "wheel_angle"]
#: Words that tell a command from a measurement; they do not count in a name.
COMMAND_WORDS = {"command", "commanded", "cmd", "target", "set", "desired", "reference"}
SPEED_UNITS = ("rad/s", "m/s")  # of wheels, in SI

WANTED = {
    "skid": "wheel speeds ('left' and 'right' in their names, rad/s or m/s) or a twist "
    "('speed' or 'vx', and 'yaw_rate' or 'wz'), measured or as commands",
    "ackermann": "a speed ('speed', 'vx', 'wheel_...' or the command 'throttle') and "
    "'steering'",
}


class Signal(NamedTuple):
    """The mean of some columns (`measured`), or of actions where no column has it.

    The `indices` are their numbers among the body's columns, or among its actions.
    """

    indices: tuple[int, ...]
    measured: bool


Kind = Literal["sides", "twist", "steered"]


class Drivetrain(NamedTuple):
    """The numbers of a body that a kinematic model is made of.

    Of 'sides', the signals are left and right speed of the wheels; of a 'twist',
    forward speed and yaw rate; of a 'steered' robot, speed and steering. Wheels that
    have one command in the same unit are `followed`, from column to command.
    """

    kind: Kind
    first: Signal
    second: Signal
    speed: int | None  # column of the forward speed if the motion decides it
    yaw_rate: int | None  # column of the yaw rate if the motion decides it
    followed: dict[int, int]


def drivetrain_of(body: Body, model: Model) -> Drivetrain:
    """The drivetrain of a body, as a kinematic model needs it; ConfigError without."""
    found = _steered(body) if model == "ackermann" else _two_sided(body)
    speed = _named(body.columns, SPEEDS, ["m/s"])
    yaw_rate = _named(body.columns, YAW_RATES, ["rad/s"])
    wanted = ""
    if found is None:
        wanted = WANTED.get(model, WANTED["skid"])
    elif body.pose == "none" and speed is None and yaw_rate is None:
        wanted = "a pose, a speed or a yaw rate"
    if found is None or wanted:
        columns, actions = (
            ", ".join(name for name, _ in part) or "none"
            for part in (body.columns, body.actions)
        )
        raise ConfigError(
            f"{model} looks for {wanted}; body '{body.name}' has columns {columns} and "
            f"actions {actions}: rename them, or take least_squares"
        )
    measured = {i for signal in found[1:] if signal.measured for i in signal.indices}
    own = [None if index in measured else index for index in (speed, yaw_rate)]
    return Drivetrain(*found, own[0], own[1], _followed(body))


def _two_sided(body: Body) -> tuple[Kind, Signal, Signal] | None:
    """Signals of a robot that turns by a difference of its sides' speeds."""
    for measured, columns in ((True, body.columns), (False, body.actions)):
        sides = _sides(columns, SPEED_UNITS if measured else ())
        if sides is not None:
            return "sides", Signal(sides[0], measured), Signal(sides[1], measured)
        speed = _named(columns, SPEEDS, ["m/s"] if measured else ())
        yaw_rate = _named(columns, YAW_RATES, ["rad/s"] if measured else ())
        if speed is not None and yaw_rate is not None:
            return "twist", Signal((speed,), measured), Signal((yaw_rate,), measured)
    return None


def _steered(body: Body) -> tuple[Kind, Signal, Signal] | None:
    """Signals of a robot that turns by the angle of its wheels."""
    speed = _named(body.columns, SPEEDS, SPEED_UNITS)
    steering = _named(body.columns, STEERINGS)
    wheels: tuple[int, ...] = () if speed is None else (speed,)
    for unit in SPEED_UNITS:  # the mean of all wheels, in the first unit that they have
        wheels = wheels or _containing(body.columns, "wheel", unit)
    first = _signal(body, wheels, SPEEDS + THROTTLES)
    second = _signal(body, () if steering is None else (steering,), STEERINGS)
    return None if first is None or second is None else ("steered", first, second)


def _signal(
    body: Body, columns: tuple[int, ...], commands: Sequence[str]
) -> Signal | None:
    """The signal of some columns, or else of the action with one of the names."""
    if columns:
        return Signal(columns, True)
    action = _named(body.actions, commands)
    return None if action is None else Signal((action,), False)


def _containing(columns: Columns, word: str, unit: str = "") -> tuple[int, ...]:
    """Numbers of the columns with a word in their names, and with a unit if given."""
    return tuple(
        index
        for index, (name, own) in enumerate(columns)
        if word in name.lower() and (not unit or SI.get(own) == unit)
    )


def _sides(
    columns: Columns, units: Sequence[str] = ()
) -> tuple[tuple[int, ...], tuple[int, ...]] | None:
    """Numbers of the left and of the right columns, all in one of the units."""
    for unit in units or ("",):
        left, right = (_containing(columns, side, unit) for side in ("left", "right"))
        if left and right:
            return left, right
    return None


def _followed(body: Body) -> dict[int, int]:
    """Wheel's column -> its command: the only one of its side, in the same unit."""
    wheels, commands = _sides(body.columns, SPEED_UNITS), _sides(body.actions)
    followed = {}
    for columns, actions in zip(wheels or (), commands or (), strict=False):
        for column in columns:
            unit = SI.get(body.columns[column][1])
            if len(actions) == 1 and SI.get(body.actions[actions[0]][1]) == unit:
                followed[column] = actions[0]
    return dict(sorted(followed.items()))


def _named(
    columns: Columns, names: Sequence[str], units: Sequence[str] = ()
) -> int | None:
    """Number of the column with the first of the names that any column has.

    The names are in small letters and without words such as 'command'. The column has
    one of the SI units, if any are given.
    """
    plain = [
        "_".join(word for word in name.lower().split("_") if word not in COMMAND_WORDS)
        if not units or SI.get(unit) in units
        else ""
        for name, unit in columns
    ]
    return next((plain.index(name) for name in names if name in plain), None)
