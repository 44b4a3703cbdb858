"""The robots in simulation: the only part of the package that needs PyBullet."""

import os


def _import_pybullet_quietly() -> None:
    """Import PyBullet without the line that it writes to standard error in every process and notebook."""
    screen, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        import pybullet  # noqa: F401
    except ImportError as error:
        raise ImportError("simulating needs PyBullet: pip install pybullet (all else works without it)") from error
    finally:
        os.dup2(screen, 2)
        os.close(screen)
        os.close(nowhere)


_import_pybullet_quietly()

from sidm.simulation.collecting import collect, discards, simulate_trajectory  # noqa: E402
from sidm.simulation.exploration import POLICIES, draw_actions  # noqa: E402
from sidm.simulation.motion import simulate  # noqa: E402
from sidm.simulation.simulator import Simulator  # noqa: E402

__all__ = ["POLICIES", "Simulator", "collect", "discards", "draw_actions", "simulate", "simulate_trajectory"]
