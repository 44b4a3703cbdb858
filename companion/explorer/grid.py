"""The stored rides of the explorer's page, one for every combination of its sliders.

`companion run --figure explorer` simulates them, in about ten minutes on one core.
What no slider changes (mass, tyres, gearing) is as in system 1's novice. The paper's
four robots drive unchanged on the same grounds.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from companion.figures.style import system_label
from ownrobot.replay.rides import (
    ROBOTS,
    SAMPLES_PER_STEP,
    Ride,
    drive,
    sampled_physics,
    weave,
)
from ownrobot.replay.viewer import pack
from sidm.drives import POSITION, QUATERNION
from sidm.pool import local_pool
from sidm.progress import progress_bar
from sidm.storage import read_arrays, write_arrays
from sidm.systems import PAPER_SYSTEMS, ROLES, Robot, Terrain
from sidm.terrain import generate_terrain

FOLDER = Path("results/explorer")
BODY = ROBOTS["system1 novice"]
#: The paper's pairs, novice and expert, by the words on their buttons.
PAIRS = {
    f"{system_label(system)}'s pair": tuple(f"{system} {role}" for role in ROLES)
    for system in PAPER_SYSTEMS
}
#: The paper's four robots, which drive with their own suspension.
PAPER_ROBOTS = {name: ROBOTS[name] for pair in PAIRS.values() for name in pair}
TERRAIN_SEED = 3
STEPS = 40
SAMPLES = STEPS * SAMPLES_PER_STEP + 1  # samples of a ride: T + 1


class Knob(NamedTuple):
    """A slider: the values that it stops at, and where it starts."""

    name: str  # field of Robot, or 'roughness' or 'throttle'
    label: str
    unit: str
    values: tuple[float, ...]
    start: float
    shown: float = 1.0  # factor that converts a value to the unit


#: Sliders of the robot's suspension.
SET_UP = (
    Knob(
        "spring",
        "spring stiffness",
        "N/m",
        (75.0, 500.0, 3000.0, 10_000.0, 50_000.0),
        BODY.spring,
    ),
    Knob("damping", "damping", "N s/m", (1.0, 50.0, 100.0), BODY.damping),
    Knob(
        "travel_lower",
        "longest extension",
        "mm",
        (-0.01, -0.02),
        BODY.travel_lower,
        -1000.0,
    ),
    Knob(
        "travel_upper",
        "deepest compression",
        "mm",
        (0.0, 0.003),
        BODY.travel_upper,
        1000.0,
    ),
)
#: Sliders of the drive.
DRIVE = (
    Knob("roughness", "height scale of the rocks", "m", (0.0, 0.35, 0.9), 0.35),
    Knob("throttle", "throttle", "of full", (0.25, 0.5, 1.0), 0.5),
)
#: All sliders. The stored rides have one axis for each, in this order.
KNOBS = SET_UP + DRIVE
#: Those of its stops, on which depends what is drawn of the robot.
STOPS = SET_UP[2:]
#: Springs, N/m, of the twins: robots that equal another one but for the spring.
SPRINGS = SET_UP[0].values
#: Whether the joint motors hold the struts, as in the recorded robots. The rides have
#: an axis for it between the axes of SET_UP and of DRIVE.
BRAKES = (True, False)
#: Throttle of the drive that weaves. It is the last on the axis of the throttle, after
#: the straight drives.
WEAVING = 0.5

#: Stored quantity -> whole numbers per unit. The quantities are the position, m; the
#: vector part of the quaternion with w >= 0; the travel of the struts, m; and angles,
#: rad: the rolls of the axles, the wheels, and the kingpins, which turn together.
CHANNELS = (
    {name: 500 for name in "xyz"}
    | {f"q{name}": 2000 for name in "xyz"}
    | {f"strut {n}": 10_000 for n in range(4)}
    | {f"roll {n}": 300 for n in range(2)}
    | {f"wheel {n}": 20 for n in range(4)}
    | {"kingpin": 100}
)
#: Columns of `Ride.joints` that are stored: two rolls, four wheels, one kingpin.
_JOINTS = [1, 3, 4, 5, 6, 7, 8]

GONE = -32768  # stored for all samples after a robot has left the ground
#: Distance from the origin, along x and y, at which all wheels still have ground, m.
BORDER = Terrain(cell_height_scale=0.0).half_width - 0.5


def whole_numbers(ride: Ride) -> np.ndarray:
    """A ride as it is stored, (T + 1, C) int16; GONE once it has left the ground."""
    quaternion = ride.states[:, QUATERNION]
    vector = np.where(quaternion[:, 3:] < 0, -quaternion, quaternion)[:, :3]
    position, joints = ride.states[:, POSITION], ride.joints[:, _JOINTS]
    columns = [*position.T, *vector.T, *ride.struts.T, *joints.T]
    scaled = np.stack(columns, axis=1) * [*CHANNELS.values()]
    outside = ~(np.abs(ride.states[:, :2]) <= BORDER).all(axis=1)
    gone = np.maximum.accumulate(outside)[:, None]
    numbers = np.where(gone, GONE, np.rint(scaled))
    return np.clip(numbers, GONE, -GONE - 1).astype(np.int16)


def twin_name(spring: float) -> str:
    """What the twin with this spring, N/m, is called."""
    return f"its twin with {spring:,.0f} N/m"


def ground(roughness: float) -> np.ndarray:
    """Heights (300, 300), m, of the ground whose rocks have that height scale, m."""
    return generate_terrain(Terrain(cell_height_scale=roughness), TERRAIN_SEED)


def set_ups() -> Iterator[Robot]:
    """The robots that the sliders can make; the last knob of SET_UP changes fastest."""
    names = [knob.name for knob in SET_UP]
    for values in itertools.product(*(knob.values for knob in SET_UP)):
        yield BODY.replace(**dict(zip(names, values, strict=True)))


def simulate(setting: tuple[Robot, bool]) -> np.ndarray:
    """Simulate the drives of a robot, with held struts or not, on every ground.

    Whole numbers (3, 4, T + 1, C) int16, one ground after the other. The last drive
    weaves.
    """
    from sidm.simulation import Simulator

    robot, brakes = setting
    roughness, throttles = (knob.values for knob in DRIVE)
    actions: list[tuple[float, Any]] = [(throttle, 0.0) for throttle in throttles]
    actions.append((WEAVING, weave(STEPS)))
    rides = []
    with Simulator(robot, ground(roughness[0]), sampled_physics(brakes)) as simulator:
        for scale in roughness:
            simulator.set_terrain(ground(scale))
            paths = [drive(simulator, *action, steps=STEPS) for action in actions]
            rides.append([whole_numbers(path) for path in paths])
    return np.array(rides)


def make(study: Any, workers: int, data: Path, results: Path) -> dict[str, Any]:
    """Simulate every ride and store it; their record has nothing but versions."""
    folder = results / FOLDER.name
    settings = list(itertools.product([*set_ups(), *PAPER_ROBOTS.values()], BRAKES))
    with (
        local_pool(workers) as pool,
        progress_bar(len(settings), "rides", "set-up") as bar,
    ):
        packed = []
        for rides in pool.map(simulate, settings):
            packed.append(np.frombuffer(pack(rides), np.uint8))
            bar.update()
    ends = np.cumsum([len(part) for part in packed])
    arrays = {"packed": np.concatenate(packed), "ends": ends}
    write_arrays(folder / "rides.npz", arrays)
    return {}


def read(folder: Path = FOLDER) -> list[bytes]:
    """The stored rides of each robot, with held, then with free struts.

    First come the robots of SET_UP, then PAPER_ROBOTS. Each part is packed from numbers
    (3, 4, T + 1, C) int16, with axes of roughness, drive, time and CHANNELS.
    FileNotFoundError says that there are none.
    """
    arrays = read_arrays(folder / "rides.npz")
    return [part.tobytes() for part in np.split(arrays["packed"], arrays["ends"][:-1])]
