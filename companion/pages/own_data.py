"""Drives for the chapter on your own data, recorded or simulated."""

from __future__ import annotations

from pathlib import Path

from ownrobot.recordings import read_drives
from ownrobot.replay.rides import ROBOTS
from sidm.body import Body
from sidm.config import ConfigError, unknown_name
from sidm.drives import Drive

SEEDS = {"novice": 0, "expert": 2}  # of a simulated robot's motion


def robot_drives(
    source: str, body: Body, minutes: float = 30.0, data: str | Path = "data"
) -> list[Drive]:
    """The drives of a recorded or a simulated robot.

    `source` is a file or folder of recordings of robots with this body, which are read
    completely, or the name of a simulated robot, such as 'system1 expert'. So many
    minutes of its motion are simulated where `data` lacks them. ConfigError says that
    `source` is neither, RecordingError that a file has a fault, and ImportError that
    PyBullet is needed and not installed.
    """
    if source in ROBOTS:
        from sidm.simulation import simulate

        system, role = source.split()
        return simulate(system, role, minutes, SEEDS[role], folder=data)
    if not Path(source).exists():
        unknown = unknown_name(source, ROBOTS, kind="simulated robot")
        raise ConfigError(f"'{source}' is no file, and {unknown}")
    return read_drives(source, body)
