"""Trajectories by the thousand: in parallel, resumable, and the same whatever the number of workers.

Trajectory i of a collection is a pure function of the collection's values and of i. A
worker simulates one shard and writes it in one piece, so a collection that was killed
goes on with the shards it lacks.
"""

from __future__ import annotations

import functools
import os
import zlib
from concurrent.futures import Executor, as_completed
from contextlib import nullcontext
from pathlib import Path

import numpy as np

from sidm.config import ConfigError, replace, to_mapping
from sidm.drives import POSITION, STEPS, TWIST, Drive, SimulatedGround, probe, upright
from sidm.pool import local_pool
from sidm.progress import progress_bar
from sidm.shards import (
    DISCARDS,
    SHARD_SIZE,
    Collection,
    load,
    simulated_drive,
    write_shard,
)
from sidm.simulation.client import bullet
from sidm.simulation.exploration import draw_actions
from sidm.simulation.simulator import Simulator
from sidm.storage import checksum, read_record, sweep, write_record
from sidm.systems import ROLES, System, find_system, is_known
from sidm.terrain import generate_terrain

#: more control steps than this within this distance, m, are stuck
STUCK_STEPS, STUCK_DISTANCE = 25, 0.1
BORDER = 1.0  # m from the terrain's edge
FASTEST = 15.0  # m/s: a body faster than this is a simulation gone wrong
MOST_ATTEMPTS = 1000  # at one trajectory


class EpisodeRules:
    """When a trajectory ends early: stuck, at the border, rolled over, or unstable (the causes in DISCARDS)."""

    def __init__(self, start: np.ndarray, half_width: float) -> None:
        """Begin with the settled state (13,) on a terrain reaching `half_width` m from the origin."""
        self._place, self._since, self._half_width = start[POSITION][:2], 0, half_width

    def ended(self, state: np.ndarray) -> str | None:
        """The cause why the trajectory ends at `state` (13,), or None; call once a control step."""
        if not np.isfinite(state).all() or np.linalg.norm(state[TWIST][:3]) > FASTEST:
            return "unstable"
        if upright(state) < 0:
            return "rollover"
        position = state[POSITION][:2]
        if np.abs(position).max() > self._half_width - BORDER:
            return "border"
        if np.linalg.norm(position - self._place) > STUCK_DISTANCE:
            self._place, self._since = position, 0
        else:
            self._since += 1
        return "stuck" if self._since > STUCK_STEPS else None


def drawn(
    collection: Collection, index: int, number: int
) -> tuple[int, float, np.ndarray]:
    """Of try number `number` at trajectory `index`: the terrain's seed, the yaw at the start, rad, actions (64, 2)."""
    names = (collection.system, collection.role, collection.policy)
    key = [zlib.crc32(name.encode()) for name in names]
    rng = np.random.default_rng(
        np.random.SeedSequence(collection.seed, spawn_key=(*key, index, number))
    )
    terrain_seed, yaw = int(rng.integers(2**62)), rng.uniform(-np.pi, np.pi)
    return (
        terrain_seed,
        yaw,
        draw_actions(collection.policy, STEPS, rng).astype(np.float32),
    )


def attempt(
    simulator: Simulator,
    system: System,
    collection: Collection,
    index: int,
    number: int,
) -> tuple[Drive | None, str | None]:
    """Try number `number` at trajectory `index`: the drive, or the cause why it is thrown away."""
    terrain_seed, yaw, actions = drawn(collection, index, number)
    heights = generate_terrain(system.terrain, terrain_seed)
    simulator.put_on(heights)
    states = [simulator.reset(0.0, 0.0, yaw)]
    rules = EpisodeRules(states[0], system.terrain.half_width)
    for action in actions:
        states.append(simulator.step(action))
        cause = rules.ended(states[-1])
        if cause:
            return None, cause
    ground = SimulatedGround(
        system.terrain, terrain_seed, checksum(heights), probe(heights)
    )
    robot = f"{collection.system} {collection.role}"
    return simulated_drive(
        robot, index, np.array(states, np.float32), actions, ground
    ), None


@functools.lru_cache(
    maxsize=1
)  # a worker keeps it from shard to shard: building one takes a quarter of a trajectory
def _simulator(system: System, role: str) -> Simulator:
    return Simulator(
        system.robot(role),
        np.zeros((system.terrain.size, system.terrain.size)),
        system.physics,
    )


def robots_of(collection: Collection, system: System | None) -> System:
    """The robots and the ground of a collection: those given, or those that are known by its name.

    Raises:
        ConfigError: no system of that name is known and none given, or another one than
            is known by that name.
    """
    if system is None:
        return find_system(collection.system)
    if system.name != collection.system:
        raise ConfigError(
            f"the collection is of '{collection.system}', the robots given are of '{system.name}'"
        )
    if (
        collection.role in ROLES
        and is_known(system.name)
        and system != find_system(system.name)
    ):
        raise ConfigError(
            f"'{system.name}' is known with other robots, ground or physics; give yours another name"
        )
    return system


def simulate_trajectory(
    collection: Collection, index: int, system: System | None = None
) -> Drive:
    """Trajectory `index` of a collection: the first attempt to last 64 steps, with the count of those that did not.

    Args:
        collection: what the trajectory is one of.
        index: its number.
        system: robots and ground; by default those of the collection's name. Of a role
            that is neither 'novice' nor 'expert' the robot is the one in the expert's
            place.

    Raises:
        ConfigError: as of `robots_of`.
        RuntimeError: none of MOST_ATTEMPTS did.
    """
    system = robots_of(collection, system)
    simulator = _simulator(
        system, collection.role if collection.role in ROLES else "expert"
    )
    causes: list[str | None] = []
    for number in range(MOST_ATTEMPTS):
        drive, cause = attempt(simulator, system, collection, index, number)
        if drive is not None:
            return replace(
                drive, discarded=tuple(causes.count(name) for name in DISCARDS)
            )
        causes.append(cause)
    raise RuntimeError(
        f"{collection}: {MOST_ATTEMPTS} attempts at trajectory {index} ended early; last: {causes[-1]}"
    )


def make_shard(
    root: Path, collection: Collection, number: int, system: System | None = None
) -> int:
    """Simulate and write one shard, as `simulate_trajectory`; how many trajectories it holds."""
    indices = range(SHARD_SIZE * number, SHARD_SIZE * (number + 1))
    write_shard(
        collection.shard(root, number),
        [simulate_trajectory(collection, index, system) for index in indices],
    )
    return SHARD_SIZE


def missing_shards(root: Path, collection: Collection, count: int) -> list[int]:
    """Numbers of the shards that the first `count` trajectories need and that are not on disk."""
    return [
        k
        for k in range(-(-count // SHARD_SIZE))
        if not collection.shard(root, k).exists()
    ]


def collect(
    root: Path | str,
    collection: Collection,
    count: int,
    workers: int | None = None,
    executor: Executor | None = None,
    progress: bool = True,
    system: System | None = None,
) -> list[Drive]:
    """The first `count` trajectories of a collection; what is on disk is read, the rest is simulated and written.

    Args:
        root: the data folder.
        collection: what to collect.
        count: trajectories.
        workers: processes, one a core when None; ignored with an `executor`.
        executor: runs the shards elsewhere; its workers write into the same `root`.
        progress: show a bar with the time left.
        system: as of `simulate_trajectory`.

    Raises:
        ConfigError: as of `robots_of`, or the folder has motion of other robots of that
            name.
        ShardError: a shard on disk is damaged; the message names it.
    """
    root = Path(root).absolute()  # the same for workers elsewhere
    if system is not None:
        _refuse_other_robots(collection.folder(root), robots_of(collection, system))
    sweep(collection.folder(root))
    missing = missing_shards(root, collection, count)
    if missing:
        bullet()  # which is known to lack before workers start
        pool = (
            nullcontext(executor)
            if executor
            else local_pool(min(workers or os.cpu_count() or 1, len(missing)))
        )
        title = f"{collection.system} {collection.role} {collection.policy}"
        with (
            pool as run,
            progress_bar(
                len(missing) * SHARD_SIZE, title, "trajectory", progress
            ) as bar,
        ):
            futures = [
                run.submit(make_shard, root, collection, number, system)
                for number in missing
            ]
            for future in as_completed(futures):
                bar.update(future.result())
    return load(root, collection, count, robots_of(collection, system).terrain)


def _refuse_other_robots(folder: Path, system: System) -> None:
    """Note beside the shards whose motion they are; ConfigError where they are another system's of the same name."""
    path, values = folder / "system.json", to_mapping(system)
    if path.exists() and read_record(path) != values:
        raise ConfigError(
            f"{folder} has motion of other robots called '{system.name}'; delete it or choose a new name"
        )
    if not path.exists():
        write_record(path, values)


def discards(drives: list[Drive]) -> dict[str, int]:
    """How many attempts were thrown away on the way to these drives, by cause."""
    return {
        cause: sum(drive.discarded[k] for drive in drives)
        for k, cause in enumerate(DISCARDS)
    }
