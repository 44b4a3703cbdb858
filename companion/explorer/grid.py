"""The rides behind the explorer's page: every combination of its sliders, simulated once and stored as whole numbers.

`companion run --figure explorer` makes them again, about ten minutes on two cores. What
the sliders do not change (mass, tyres, gearing) is the novice's of system 1; the
paper's four robots ride on the same grounds as they are.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from companion.numerics import versions
from sidm.drives import POSITION, QUATERNION
from sidm.pool import local_pool
from sidm.progress import progress_bar
from sidm.replay.packing import pack, unpack
from sidm.replay.rides import ROBOTS, SAMPLES, Ride, drive, sampled_physics, weave
from sidm.storage import read_arrays, read_record, write_arrays, write_record
from sidm.systems import ROLES, Robot, Terrain
from sidm.terrain import generate_terrain

FOLDER = Path("results/explorer")
BODY = ROBOTS["system1 novice"]
#: The paper's four robots, which ride as they are.
PAPERS = {
    name: ROBOTS[name]
    for name in (f"system{number} {role}" for number in (1, 2) for role in ROLES)
}
TERRAIN_SEED = 3
STEPS = 40
MOMENTS = STEPS * SAMPLES + 1


class Knob(NamedTuple):
    """A slider: the values that it stops at, and where it starts."""

    name: str  # of a Robot's field, or 'roughness' or 'throttle'
    label: str
    unit: str
    values: tuple[float, ...]
    start: float
    shown: float = 1.0  # what a value is multiplied with to be shown in its unit


#: Of the robot's set-up, then of the drive; the stored rides have one axis a knob, in
#: this order.
SET_UP = (
    Knob(
        "spring",
        "spring stiffness",
        "N/m",
        (75.0, 500.0, 3000.0, 10_000.0, 50_000.0),
        BODY.spring,
    ),
    Knob("damping", "damping", "N s/m", (1.0, 20.0, 50.0, 100.0), BODY.damping),
    Knob(
        "travel_lower",
        "longest extension",
        "mm",
        (-0.005, -0.01, -0.02, -0.03),
        BODY.travel_lower,
        -1000.0,
    ),
)
DRIVE = (
    Knob("roughness", "height scale of the rocks", "m", (0.0, 0.2, 0.35, 0.9), 0.35),
    Knob("throttle", "throttle", "of full", (0.25, 0.5, 0.75, 1.0), 0.5),
)
KNOBS = SET_UP + DRIVE
#: whether the struts are braked as in the recorded robot; the axis before the drive's
BRAKES = (True, False)
#: throttle of the drive that weaves, which comes after the straight ones on their axis
WEAVING = 0.5

#: What is stored of a moment -> how many whole numbers a unit: m, of the vector of the
#: quaternion with w >= 0, m of the struts, rad of the axles' rolls, of the wheels and
#: of the kingpins, which turn alike.
CHANNELS = (
    {name: 500 for name in "xyz"}
    | {f"q{name}": 2000 for name in "xyz"}
    | {f"strut {n}": 10_000 for n in range(4)}
    | {f"roll {n}": 300 for n in range(2)}
    | {f"wheel {n}": 20 for n in range(4)}
    | {"kingpin": 100}
)

GONE = -32768
#: m from the origin, where the wheels still have ground
BORDER = Terrain(cell_height_scale=0.0).half_width - 0.5


class Grid(NamedTuple):
    """The stored rides: axes of SET_UP (or the robots of PAPERS), BRAKES, roughness, drive, time and CHANNELS."""

    rides: np.ndarray  # (5, 4, 4, 2, 4, 5, T + 1, C) int16
    robots: np.ndarray  # (4, 2, 4, 5, T + 1, C) int16
    #: (4, 5, T + 1, C) each: set-ups, then robots of the paper; braked, then free
    packed: tuple[bytes, ...]
    numerics: dict[str, int]  # versions that they were made with


def whole_numbers(one: Ride) -> np.ndarray:
    """A ride as it is stored, (T + 1, C) int16; GONE from where it leaves the ground."""
    turn = one.states[:, QUATERNION]
    turn = np.where(turn[:, 3:] < 0, -turn, turn)[:, :3]
    columns = [
        *one.states[:, POSITION].T,
        *turn.T,
        *one.struts.T,
        *one.joints.T[[1, 3, 4, 5, 6, 7, 8]],
    ]
    scaled = [
        scale * column for scale, column in zip(CHANNELS.values(), columns, strict=True)
    ]
    outside = ~(np.abs(one.states[:, :2]) <= BORDER).all(axis=1)
    numbers = np.where(
        np.maximum.accumulate(outside)[:, None], GONE, np.rint(np.stack(scaled, axis=1))
    )
    return np.clip(numbers, GONE, -GONE - 1).astype(np.int16)


def ground(roughness: float) -> np.ndarray:
    """Heights (300, 300) of the ground of that roughness, m."""
    return generate_terrain(Terrain(cell_height_scale=roughness), TERRAIN_SEED)


def set_ups() -> Iterator[Robot]:
    """The robots that the sliders can make, the last knob of SET_UP fastest."""
    for values in itertools.product(*(knob.values for knob in SET_UP)):
        changed = dict(zip((knob.name for knob in SET_UP), values, strict=True))
        yield BODY.replace(**changed)


def simulate(
    setting: tuple[Robot, bool], drives: Sequence[int] = range(len(DRIVE[1].values) + 1)
) -> np.ndarray:
    """All drives of one robot, braked or not: (4, drives, T + 1, C) int16; the last of them weaves."""
    from sidm.simulation import Simulator

    robot, brakes = setting
    roughness, throttles = (knob.values for knob in DRIVE)
    straight: list[tuple[float, float | np.ndarray]] = [
        (throttle, 0.0) for throttle in throttles
    ]
    actions = [*straight, (WEAVING, weave(STEPS))]
    found = []
    with Simulator(robot, ground(roughness[0]), sampled_physics(brakes)) as simulator:
        for rough in roughness:
            simulator.put_on(ground(rough))
            found.append(
                [
                    whole_numbers(drive(simulator, *actions[number], steps=STEPS))
                    for number in drives
                ]
            )
    return np.array(found)


def make(study: Any, workers: int) -> None:
    """`companion run --figure explorer`: simulate every ride and store them."""
    folder = Path(study.results) / FOLDER.name
    settings = list(itertools.product([*set_ups(), *PAPERS.values()], BRAKES))
    with (
        local_pool(workers) as pool,
        progress_bar(len(settings), "rides", "set-up") as bar,
    ):
        packed = []
        for one in pool.map(simulate, settings):
            packed.append(np.frombuffer(pack(one), np.uint8))
            bar.update()
    arrays = {
        "packed": np.concatenate(packed),
        "ends": np.cumsum([len(one) for one in packed]),
    }
    write_arrays(folder / "rides.npz", arrays)
    write_record(folder / "rides.json", {"numerics": versions("free_struts")})
    read.cache_clear()


@functools.cache
def read(folder: Path = FOLDER) -> Grid:
    """The stored rides.

    Raises:
        FileNotFoundError: there are none.
        Damaged: a file is not as it was written.
    """
    arrays = read_arrays(folder / "rides.npz")
    packed = [one.tobytes() for one in np.split(arrays["packed"], arrays["ends"][:-1])]
    roughness, throttles = (len(knob.values) for knob in DRIVE)
    drives = roughness, throttles + 1, MOMENTS, len(CHANNELS)
    every = np.array([unpack(one, drives) for one in packed]).reshape(
        -1, len(BRAKES), *drives
    )
    rides = every[: -len(PAPERS)].reshape(
        *(len(knob.values) for knob in SET_UP), *every.shape[1:]
    )
    return Grid(
        rides,
        every[-len(PAPERS) :],
        tuple(packed),
        read_record(folder / "rides.json")["numerics"],
    )
