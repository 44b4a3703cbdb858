"""The robots of the chapter on your own data: recordings, or simulated robots by their names."""

from __future__ import annotations

from pathlib import Path

from sidm.body import Body
from sidm.config import ConfigError, unknown_name
from sidm.drives import Drive
from sidm.recordings import read_drives
from sidm.systems import ROLES, SYSTEMS

SEEDS = {"novice": 0, "expert": 2}  # of a simulated robot's motion

#: Robots of the paper by what they are called here -> system and role.
SIMULATED = {f"{system} {role}": (system, role) for system in SYSTEMS for role in ROLES}


def robot_drives(
    source: str, body: Body, minutes: float = 30.0, data: str | Path = "data"
) -> list[Drive]:
    """The drives of a robot.

    Args:
        source: a file or folder of recordings, or the name of a simulated robot, as
            'system1 expert'.
        body: of recordings; a simulated robot's is `body.ROVER`.
        minutes: of a simulated robot's motion, simulated where it is missing; of
            recordings all are taken.
        data: the folder of simulated motion.

    Raises:
        ConfigError: there is no such file and no such robot.
        RecordingError: a file has a fault.
        ImportError: PyBullet is needed and not installed; one line.
    """
    if source in SIMULATED:
        from sidm.simulation import simulate

        system, role = SIMULATED[source]
        return simulate(system, role, minutes, SEEDS[role], folder=data)
    if not Path(source).exists():
        raise ConfigError(
            f"'{source}' is no file, and {unknown_name(source, SIMULATED, 'the simulated robots')}"
        )
    return read_drives(source, body)
