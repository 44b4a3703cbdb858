"""Motion of a simulated robot in one call: `sidm.simulate`."""

from __future__ import annotations

import contextlib
import operator
from pathlib import Path

from sidm.config import ConfigError, hint
from sidm.drives import Drive
from sidm.shards import Collection, trajectories_for
from sidm.simulation.collecting import (
    collect,
    collection_bar,
    kept,
    simulate_trajectory,
)
from sidm.simulation.exploration import POLICIES
from sidm.systems import ROLES, System, find_system


def simulate(
    system: System | str,
    role: str,
    minutes: float,
    seed: int = 0,
    *,
    policy: str = "ornstein_uhlenbeck",
    folder: str | Path | None = None,
    workers: int = 1,
    progress: bool = True,
) -> list[Drive]:
    """Simulate a robot that explores rough ground (section 5 of the paper).

    Each drive begins at rest in the middle of new ground, with a random heading, and
    lasts 64 steps of 0.1 s. A drive is a pure function of the arguments up to `policy`
    and of its number: more minutes begin with the same drives.

    Args:
        system: a pair of robots and their ground, or the name of one of `sidm.SYSTEMS`.
        role: which robot of the pair, 'novice' or 'expert'.
        minutes: how much motion, min; at least two drives are made.
        seed: of ground, heading and actions; use different seeds for training and
            evaluation.
        policy: the policy that draws the actions, one of `sidm.simulation.POLICIES`.
        folder: where drives are stored; stored ones are not simulated again. None:
            drives are kept in memory only.
        workers: number of processes, with a `folder`; with more than one, a script's
            call must stand under `if __name__ == "__main__":`.
        progress: whether to show a progress bar.

    Returns:
        The drives, each with states (65, 13), actions (64, 2) and the ground.

    Examples:
        >>> system = sidm.SYSTEMS["system1"]
        >>> drives = sidm.simulate(system, "novice", minutes=0.2, seed=3)
        >>> drives[0]
        Drive('system1 novice 0': 64 steps of 0.1 s, body 'rover')
        >>> len(drives), drives[0].states.shape, drives[0].actions.shape
        (2, (65, 13), (64, 2))
        >>> drives[0].ground.heights.shape
        (300, 300)
    """
    system = find_system(system) if isinstance(system, str) else system
    if not isinstance(system, System):
        raise TypeError(
            f"a system is a sidm.System or the name of one, not {type(system).__name__}"
        )
    for name, value, known in (("role", role, ROLES), ("policy", policy, POLICIES)):
        if value not in known:
            raise ConfigError(f"{name} {value!r}; {hint(str(value), known)}")
    if not 0 < minutes < float("inf"):
        raise ConfigError(f"minutes must be positive, not {minutes}")
    seed = operator.index(seed)  # NumPy's integers are seeds, too
    collection = Collection(system=system.name, role=role, policy=policy, seed=seed)
    count = trajectories_for(minutes)
    if folder is not None:
        return collect(
            folder, collection, count, workers=workers, progress=progress, system=system
        )
    drives = []
    with collection_bar(collection, count, progress) as bar, contextlib.closing(kept):
        for index in range(count):
            drives.append(simulate_trajectory(collection, index, system))
            bar.update()
    return drives
