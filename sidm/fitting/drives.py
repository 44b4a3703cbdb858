"""Drives for `fit` by what a user calls them, and some of them held out to judge by."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sidm.body import Body
from sidm.config import ConfigError, unknown_name
from sidm.recordings import Drive, Ground, read_drives
from sidm.systems import ROLES, SYSTEMS, System
from sidm.terrain import generate_terrain
from sidm.trajectory import Collection, Trajectory, trajectories_for

SEEDS = {"novice": 0, "expert": 2}  # of a simulated robot's motion

#: Robots of the paper by what they are called here -> system and role.
SIMULATED = {f"{system} {role}": (system, role) for system in SYSTEMS for role in ROLES}


def robot_drives(
    source: str, body: Body, minutes: float = 30.0, data: str | Path = "data", policy: str = "ornstein_uhlenbeck"
) -> list[Drive]:
    """The drives of a robot.

    Args:
        source: a file or folder of recordings, or the name of a simulated robot, as 'system1 expert'.
        body: of recordings; a simulated robot's is `body.ROVER`.
        minutes: of a simulated robot's motion, simulated where it is missing; of recordings all are taken.
        data: the folder of simulated trajectories.
        policy: of a simulated robot's random actions.

    Raises:
        ConfigError: there is no such file, no such robot or no such policy.
        RecordingError: a file has a fault.
        ImportError: PyBullet is needed and not installed; one line.
    """
    if source in SIMULATED:
        from sidm.simulation import collect

        system, role = SIMULATED[source]
        collection = Collection(system=system, role=role, policy=policy, seed=SEEDS[role])
        return [as_drive(one, SYSTEMS[system]) for one in collect(data, collection, trajectories_for(minutes))]
    if not Path(source).exists():
        raise ConfigError(f"'{source}' is no file, and {unknown_name(source, SIMULATED, 'the simulated robots')}")
    return read_drives(source, body)


def as_drive(trajectory: Trajectory, system: System) -> Drive:
    """A simulated trajectory as a recorded one, with its ground."""
    ground = Ground(generate_terrain(system.terrain, trajectory.terrain_seed), system.terrain.spacing)
    name = f"{system.name} trajectory {trajectory.index}"
    return Drive(name, name, trajectory.states.astype(float), trajectory.actions.astype(float), ground)


def hold_out(drives: Sequence[Drive], share: float) -> tuple[list[Drive], list[Drive]]:
    """Drives to learn from and to judge by: whole sessions, or of a single one its drives, the last.

    Those that judge have at most a `share` of the steps, but for the last session or drive, which always judges.

    Raises:
        ConfigError: there is but one drive.
    """
    if len(drives) < 2:
        raise ConfigError("a single drive leaves none to judge by: record another, or cut it in two")
    alone = len({drive.session for drive in drives}) == 1
    units: dict[str, list[Drive]] = {}
    for number, drive in enumerate(drives):
        units.setdefault(str(number) if alone else drive.session, []).append(drive)
    lengths = [sum(len(drive.actions) for drive in unit) for unit in units.values()]
    left = np.cumsum(lengths[::-1])[::-1]  # steps from each unit to the end
    first = next((n for n in range(1, len(left)) if left[n] <= share * left[0]), len(left) - 1)
    grouped = list(units.values())
    return sum(grouped[:first], []), sum(grouped[first:], [])
