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

SPEEDS = (
    "speed",
    "velocity",
    "forward_speed",
    "linear_velocity",
    "linear",
    "linear_x",
    "vx",
    "v",
)
YAW_RATES = (
    "yaw_rate",
    "turn_rate",
    "angular_velocity",
    "angular",
    "angular_z",
    "wz",
    "gyro_z",
    "omega",
    "w",
)
THROTTLES = ("throttle", "accelerator", "gas")
STEERINGS = ("steering", "steer", "steering_angle", "steer_angle", "wheel_angle")
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
    """The mean of some columns, or of some actions where no column measures it.

    Attributes:
        indices: numbers of these columns among the body's columns, or of these actions
            among its actions
        measured: whether they are columns
        unit: SI unit
    """

    indices: tuple[int, ...]
    measured: bool
    unit: str


class Drivetrain(NamedTuple):
    """The numbers of a body that a kinematic model is made of.

    Attributes:
        kind: 'sides': left and right speed of the wheels; 'twist': forward speed and
            yaw rate; 'steered': speed and steering
        first: left speed, forward speed or speed
        second: right speed, yaw rate or steering
        speed: column of the robot's forward speed if the motion decides it, else None
        yaw_rate: column of the robot's yaw rate if the motion decides it, else None
        followed: number of a wheel's column -> number of its command, for wheels that
            have one command in the same unit
    """

    kind: Literal["sides", "twist", "steered"]
    first: Signal
    second: Signal
    speed: int | None
    yaw_rate: int | None
    followed: dict[int, int]


def drivetrain_of(body: Body, model: Model) -> Drivetrain:
    """The drivetrain of a body, as a kinematic model needs it."""
    found = _steered(body) if model == "ackermann" else _two_sided(body)
    speed = _named(body.columns, SPEEDS, ["m/s"])
    yaw_rate = _named(body.columns, YAW_RATES, ["rad/s"])
    if found is None:
        raise _refusal(body, model, WANTED.get(model, WANTED["skid"]))
    if body.pose == "none" and speed is None and yaw_rate is None:
        raise _refusal(body, model, "a pose, a speed or a yaw rate")
    kind, first, second = found
    of_signals = {
        index
        for signal in (first, second)
        if signal.measured
        for index in signal.indices
    }
    return Drivetrain(
        kind,  # type: ignore[arg-type]
        first,
        second,
        speed if speed not in of_signals else None,
        yaw_rate if yaw_rate not in of_signals else None,
        _followed(body),
    )


def _refusal(body: Body, model: Model, wanted: str) -> ConfigError:
    columns, actions = (
        ", ".join(name for name, _ in part) or "none"
        for part in (body.columns, body.actions)
    )
    return ConfigError(
        f"{model} looks for {wanted}; body '{body.name}' has columns {columns} and "
        f"actions {actions}: rename them, or take least_squares"
    )


def _two_sided(body: Body) -> tuple[str, Signal, Signal] | None:
    """Signals of a robot that turns by a difference of its sides' speeds."""
    wheels = _sides(body.columns, SPEED_UNITS)
    if wheels is not None:
        unit = SI.get(body.columns[wheels[0][0]][1], "")
        left, right = (Signal(side, True, unit) for side in wheels)
        return "sides", left, right
    twist = _twist(body.columns, measured=True)
    if twist is not None:
        return "twist", *twist
    commands = _sides(body.actions)
    if commands is not None:
        left, right = (Signal(side, False, "") for side in commands)
        return "sides", left, right
    twist = _twist(body.actions, measured=False)
    return None if twist is None else ("twist", *twist)


def _steered(body: Body) -> tuple[str, Signal, Signal] | None:
    """Signals of a robot that turns by the angle of its wheels."""
    speed = _signal(body, SPEEDS, SPEEDS + THROTTLES, wheels=True)
    steering = _signal(body, STEERINGS, STEERINGS)
    if speed is None or steering is None:
        return None
    return "steered", speed, steering


def _signal(
    body: Body, names: Sequence[str], commands: Sequence[str], wheels: bool = False
) -> Signal | None:
    """A signal of a column, of the `wheels` together, or of a command."""
    column = _named(body.columns, names, SPEED_UNITS if wheels else ())
    if column is not None:
        return Signal((column,), True, SI.get(body.columns[column][1], ""))
    for unit in SPEED_UNITS if wheels else ():
        columns = tuple(
            index
            for index, (name, own) in enumerate(body.columns)
            if SI.get(own) == unit and "wheel" in name.lower()
        )
        if columns:
            return Signal(columns, True, unit)
    action = _named(body.actions, commands)
    if action is None:
        return None
    return Signal((action,), False, SI.get(body.actions[action][1], ""))


def _twist(columns: Columns, measured: bool) -> tuple[Signal, Signal] | None:
    """Forward speed and yaw rate among columns or actions."""
    units = ("m/s", "rad/s") if measured else ("", "")
    indices = [
        _named(columns, names, [unit] if unit else ())
        for names, unit in zip((SPEEDS, YAW_RATES), units, strict=True)
    ]
    speed, yaw_rate = (
        None if i is None else Signal((i,), measured, SI.get(columns[i][1], ""))
        for i in indices
    )
    return None if speed is None or yaw_rate is None else (speed, yaw_rate)


def _sides(
    columns: Columns, units: Sequence[str] = ()
) -> tuple[tuple[int, ...], tuple[int, ...]] | None:
    """Numbers of the left and of the right columns, all in one of the units."""
    for unit in units or ("",):
        left, right = (
            tuple(
                index
                for index, (name, own) in enumerate(columns)
                if side in name.lower() and (not units or SI.get(own) == unit)
            )
            for side in ("left", "right")
        )
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

    The names are without words such as 'command'. The column has one of the SI units,
    if any are given.
    """
    plain = [
        _without_command(name) if not units or SI.get(unit) in units else ""
        for name, unit in columns
    ]
    found = [plain.index(name) for name in names if name in plain]
    return found[0] if found else None


def _without_command(name: str) -> str:
    """A name in small letters, without words such as 'command'."""
    words = name.lower().split("_")
    return "_".join(word for word in words if word not in COMMAND_WORDS)
