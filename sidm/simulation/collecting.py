"""Simulate thousands of trajectories in parallel, with the same result on any machine.

Trajectory i of a collection is a pure function of the collection's values and of i, so
the number of workers changes nothing. A worker simulates one shard and writes it in one
piece, so a collection that was killed continues with the shards that are missing.
"""

from __future__ import annotations

import os
import threading
import zlib
from concurrent.futures import Executor
from contextlib import closing, nullcontext
from pathlib import Path

import numpy as np

from sidm.config import ConfigError, replace, to_mapping
from sidm.drives import POSITION, STEPS, TWIST, Drive, SimulatedGround, probe, upright
from sidm.pool import as_completed, local_pool
from sidm.progress import Bar, progress_bar
from sidm.shards import (
    DISCARDS,
    SHARD_SIZE,
    Collection,
    ShardError,
    Which,
    load,
    missing_shards,
    simulated_drive,
    write_shard,
)
from sidm.simulation.client import bullet
from sidm.simulation.exploration import draw_actions
from sidm.simulation.simulator import Simulator
from sidm.storage import Damaged, checksum, read_record, sweep, write_record
from sidm.systems import ROLES, System, find_system, is_system
from sidm.terrain import generate_terrain

#: a robot is stuck after more control steps than this within this distance, m
STUCK_STEPS, STUCK_DISTANCE = 25, 0.1
BORDER = 1.0  # m, a trajectory ends this near to the edge of the terrain
MAX_SPEED = 15.0  # m/s, at a higher speed of the body the simulation has gone wrong
MAX_ATTEMPTS = 1000  # at one trajectory


class EpisodeRules:
    """The rules that end a trajectory early, for the causes in DISCARDS.

    `start` is the settled state (13,), `half_width` the distance from the origin to the
    terrain's edge, m, along both axes or (2,) along x and y.
    """

    def __init__(self, start: np.ndarray, half_width: float | np.ndarray) -> None:
        self._half_width = half_width
        self._place, self._steps_there = start[POSITION][:2], 0

    def ended(self, state: np.ndarray) -> str | None:
        """The cause that ends the trajectory at the state (13,) after a step."""
        if not np.isfinite(state).all() or np.linalg.norm(state[TWIST][:3]) > MAX_SPEED:
            return "unstable"
        if upright(state) < 0:
            return "rollover"
        position = state[POSITION][:2]
        if (np.abs(position) > self._half_width - BORDER).any():
            return "border"
        if np.linalg.norm(position - self._place) > STUCK_DISTANCE:
            self._place, self._steps_there = position, 0
        else:
            self._steps_there += 1
        return "stuck" if self._steps_there > STUCK_STEPS else None


def draw_attempt(
    collection: Collection, index: int, number: int
) -> tuple[int, float, np.ndarray]:
    """Ground's seed, yaw, rad, and actions (64, 2) of an attempt at a trajectory."""
    names = (collection.system, collection.role, collection.policy)
    key = [zlib.crc32(name.encode()) for name in names]
    rng = np.random.default_rng(
        np.random.SeedSequence(collection.seed, spawn_key=(*key, index, number))
    )
    terrain_seed, yaw = int(rng.integers(2**62)), rng.uniform(-np.pi, np.pi)
    actions = draw_actions(collection.policy, STEPS, rng).astype(np.float32)
    return terrain_seed, yaw, actions


def simulate_attempt(
    simulator: Simulator,
    system: System,
    collection: Collection,
    index: int,
    number: int,
) -> Drive | str:
    """An attempt's drive, or the cause for which it is discarded."""
    terrain_seed, yaw, actions = draw_attempt(collection, index, number)
    heights = generate_terrain(system.terrain, terrain_seed)
    simulator.set_terrain(heights)
    states = [simulator.reset(0.0, 0.0, yaw)]
    rules = EpisodeRules(states[0], system.terrain.half_width)
    for action in actions:
        states.append(simulator.step(action))
        cause = rules.ended(states[-1])
        if cause:
            return cause
    ground = SimulatedGround(
        system.terrain, terrain_seed, checksum(heights), probe(heights)
    )
    robot = f"{collection.system} {collection.role}"
    path = np.array(states, np.float32)
    return simulated_drive(robot, index, path, actions, ground)


class _Kept(threading.local):
    """The simulator that a thread keeps from trajectory to trajectory.

    Building one takes a quarter of the time of a trajectory.
    """

    made_for: tuple[System, str] | None = None
    simulator: Simulator | None = None

    def get(self, system: System, role: str) -> Simulator:
        """A simulator of a system's robot on flat ground."""
        if self.simulator is None or self.made_for != (system, role):
            self.close()
            flat = np.zeros((system.terrain.size, system.terrain.size))
            self.simulator = Simulator(system.robot(role), flat, system.physics)
            self.made_for = system, role
        return self.simulator

    def close(self) -> None:
        """Free it: with a connection left open, the user's PyBullet would act on it."""
        if self.simulator is not None:
            self.simulator.close()
            self.simulator = None


kept = _Kept()


def system_of(collection: Collection, system: System | None) -> System:
    """The system of a collection: the given one, or the known one of that name."""
    if system is None:
        return find_system(collection.system)
    name = system.name
    if name != collection.system:
        raise ConfigError(
            f"the collection is of '{collection.system}', "
            f"the robots given are of '{name}'"
        )
    if collection.role in ROLES and is_system(name) and system != find_system(name):
        raise ConfigError(
            f"'{name}' is known with other robots, ground or physics; "
            "give yours another name"
        )
    return system


def simulate_trajectory(
    collection: Collection, index: int, system: System | None = None
) -> Drive:
    """Simulate trajectory `index`, the first attempt that lasts 64 control steps.

    For a role that is neither 'novice' nor 'expert', the system's expert is the robot.
    """
    system = system_of(collection, system)
    role = collection.role if collection.role in ROLES else "expert"
    simulator = kept.get(system, role)
    causes: list[str] = []
    for number in range(MAX_ATTEMPTS):
        made = simulate_attempt(simulator, system, collection, index, number)
        if isinstance(made, Drive):
            counts = tuple(causes.count(name) for name in DISCARDS)
            return replace(made, discarded=counts)
        causes.append(made)
    raise RuntimeError(
        f"{collection}: {MAX_ATTEMPTS} attempts at trajectory {index} ended early; "
        f"last: {causes[-1]}"
    )


def make_shard(
    root: Path, collection: Collection, number: int, system: System | None = None
) -> int:
    """Simulate and write shard `number`; returns how many trajectories it holds."""
    indices = range(SHARD_SIZE * number, SHARD_SIZE * (number + 1))
    write_shard(
        collection.shard(root, number),
        [simulate_trajectory(collection, index, system) for index in indices],
    )
    return SHARD_SIZE


def collect(
    root: Path | str,
    collection: Collection,
    which: Which,
    workers: int | None = None,
    executor: Executor | None = None,
    progress: bool = True,
    system: System | None = None,
) -> list[Drive]:
    """Drives of a collection, in the order of `which`.

    Shards on disk are read; missing ones are simulated and written first.

    Args:
        root: the data folder.
        collection: what to collect.
        which: how many trajectories, the first ones; or their indices.
        workers: number of processes; None: one for each core.
        executor: runs the shards elsewhere; its workers write into the same `root`.
        progress: whether to show a bar with the time left.
        system: robots and ground, as in `simulate_trajectory`.

    Raises:
        ConfigError: the collection's system is not known or not `system`, or the folder
            holds motion of other robots of the same name.
        ShardError: a shard on disk is damaged; the message names it.
    """
    root = Path(root).absolute()  # workers may have another working directory
    folder = collection.folder(root)
    if system is not None:
        values = to_mapping(system_of(collection, system))
        described = folder / "system.json"
        try:
            known = read_record(described) if described.exists() else None
        except Damaged as error:
            raise ShardError(
                f"{described}: damaged ({error}); delete its folder and collect again"
            ) from None
        if known is None:
            write_record(described, values)
        elif known != values:
            raise ConfigError(
                f"{folder} has motion of other robots called '{system.name}'; "
                "delete it or choose a new name"
            )
    sweep(folder)
    missing = missing_shards(root, collection, which)
    if missing:
        bullet()  # a missing PyBullet is reported before workers start
        processes = min(workers or os.cpu_count() or 1, len(missing))
        pool = nullcontext(executor) if executor else local_pool(processes)
        total = len(missing) * SHARD_SIZE
        bar = collection_bar(collection, total, progress)
        with pool as run, closing(kept), bar:
            futures = [
                run.submit(make_shard, root, collection, number, system)
                for number in missing
            ]
            for future in as_completed(futures):
                bar.update(future.result())
    return load(root, collection, which, system_of(collection, system).terrain)


def collection_bar(collection: Collection, total: int, shown: bool) -> Bar:
    """A progress bar that counts `total` trajectories of a collection."""
    title = f"{collection.system} {collection.role} {collection.policy}"
    return progress_bar(total, title, "trajectory", shown)


def discards(drives: list[Drive]) -> dict[str, int]:
    """How many attempts were discarded before these drives, by cause."""
    return {
        cause: sum(drive.discarded[k] for drive in drives)
        for k, cause in enumerate(DISCARDS)
    }
