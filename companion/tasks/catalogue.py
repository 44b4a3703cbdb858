"""The tasks of the benchmark: which robots, how much motion, what is predicted.

A task gives a method drives of a novice and of an expert, and judges the model by
drives of the novice that the method never gets. Simulated robots are those of the
paper, with struts held by motors or free, two pairs of the family, and novices with
other bodies; real robots are a Husky and a Warthog.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from companion.bodies import NOVICES, seen_by
from ownrobot.body_file import read_body
from ownrobot.fitting.splits import drives_of_sessions, session_order
from ownrobot.recordings import read_drives
from sidm.body import ROVER, Body
from sidm.config import ConfigError, config, replace, unknown_name
from sidm.drives import Drive, minutes_of
from sidm.shards import trajectories_for
from sidm.systems import FAMILY_PAIRS, FREE_SYSTEMS, PAPER_SYSTEMS

if TYPE_CHECKING:
    from companion.tasks.trial import EntryResult

RECORDINGS = Path("recordings")
HELD_OUT = 0.25  # share of a real robot's sessions that judge
#: Seeds of the simulated motion: the novice's to learn from, the novice's to judge by,
#: and the expert's.
POOL_SEED, VALIDATION_SEED, EXPERT_SEED = 40, 41, 42
POOL_MINUTES = 60.0  # of the novice's motion, from which each seed draws


@config
class Task:
    """One task; its seeds draw different drives of the novice.

    Attributes:
        name: as in the table
        pair: a simulated pair of robots, or '' for real robots
        novice: name of the novice's body for a simulated pair, else of a real robot
        expert: of a real robot; '' for a simulated pair
        minutes: of the novice's motion, min
        expert_minutes: of the expert's motion, min; 0: all that is recorded
        validation_minutes: of the motion that judges, min; 0: what is held out
        version: is raised when the task's motion or its rules change
    """

    name: str
    pair: str = ""
    novice: str = "rover"
    expert: str = ""
    minutes: float
    expert_minutes: float = 0.0
    validation_minutes: float = 0.0
    version: int = 1


class TaskData(NamedTuple):
    """The motion of a task and a seed."""

    novice: list[Drive]
    expert: list[Drive]
    validation: list[Drive]


def _simulated(pair: str, minutes: float, novice: str = "rover") -> Task:
    body = "" if novice == "rover" else f", {novice}"
    return Task(
        name=f"{pair}{body}, {minutes:g} min",
        pair=pair,
        novice=novice,
        minutes=minutes,
        expert_minutes=60.0,
        validation_minutes=20.0,
    )


def _recorded(novice: str, expert: str, minutes: float) -> Task:
    return Task(
        name=f"{expert} to {novice}, {minutes:g} min",
        novice=novice,
        expert=expert,
        minutes=minutes,
    )


RECORDED_PAIRS = (("warthog", "husky"), ("husky", "warthog"))  # novice, expert
MINUTES = (1.0, 5.0, 20.0)  # of the paper's novices
BODIES = ("no map", "no linear velocity", "left and right")
#: Groups of tasks by name; real robots need no simulation.
GROUPS: dict[str, tuple[Task, ...]] = {
    "quick": tuple(_recorded(*pair, m) for m in (0.8, 5.0) for pair in RECORDED_PAIRS),
    "held": tuple(_simulated(pair, m) for pair in PAPER_SYSTEMS for m in MINUTES),
    "free": tuple(_simulated(pair, m) for pair in FREE_SYSTEMS for m in MINUTES),
    "family": tuple(_simulated(pair, 5.0) for pair in FAMILY_PAIRS),
    "bodies": tuple(_simulated("system1", 5.0, body) for body in BODIES),
}
#: All tasks by name.
TASKS = {task.name: task for group in GROUPS.values() for task in group}
SEEDS = 3


def find_tasks(name: str) -> list[Task]:
    """The tasks of a name: that of one task, of a group, or 'all'."""
    if name == "all":
        return [*TASKS.values()]
    if name in GROUPS:
        return [*GROUPS[name]]
    if name not in TASKS:
        raise unknown_name(name, (*GROUPS, "all", *TASKS), kind="task")
    return [TASKS[name]]


def load_task(
    task: Task,
    seed: int,
    data: str | Path = "data",
    *,
    workers: int = 1,
    progress: bool = False,
) -> TaskData:
    """The motion of a task; simulated motion that is missing is simulated.

    The seed says which of the novice's drives are learnt from, and for real robots
    also which judge. Simulated motion lies under `data`.
    """
    if not task.pair:
        return _read(task, seed)
    from sidm.simulation import simulate

    drives_of = functools.partial(
        simulate,
        task.pair,
        folder=Path(data) / "benchmark",
        workers=workers,
        progress=progress,
    )
    pool = drives_of("novice", POOL_MINUTES, POOL_SEED)
    order = np.random.default_rng(seed).permutation(len(pool))
    chosen = [pool[n] for n in order[: trajectories_for(task.minutes)]]
    validation = drives_of("novice", task.validation_minutes, VALIDATION_SEED)
    expert = drives_of("expert", task.expert_minutes, EXPERT_SEED)
    _, body = bodies(task)
    chosen, validation = (seen_by(drives, body) for drives in (chosen, validation))
    return TaskData(_own_sessions(chosen), _own_sessions(expert), validation)


def _own_sessions(drives: list[Drive]) -> list[Drive]:
    """The drives, each a session: simulated drives are independent."""
    return [replace(drive, session=f"{drive.index}") for drive in drives]


def recorded_body() -> Body:
    """The body of the real robots."""
    if not RECORDINGS.is_dir():
        raise ConfigError(
            f"{RECORDINGS}: there is no such folder; run this in the repository's, "
            "or take simulated robots (--tasks held)"
        )
    return read_body(RECORDINGS / "skid_steer.yaml")


def bodies(task: Task) -> tuple[Body, Body]:
    """The bodies of the expert and of the novice."""
    if not task.pair:
        return recorded_body(), recorded_body()
    return ROVER, ROVER if task.novice == "rover" else NOVICES[task.novice]


@functools.cache
def _robot(name: str) -> list[Drive]:
    """All drives of a real robot."""
    return read_drives(RECORDINGS / f"{name}.csv.gz", recorded_body())


def _read(task: Task, seed: int) -> TaskData:
    drives = _robot(task.novice)
    order = session_order(drives, seed)
    count = round(HELD_OUT * len(order))
    validation, pool = drives_of_sessions(drives, order[:count]), order[count:]
    for used in range(1, len(pool) + 1):
        novice = drives_of_sessions(drives, pool[:used])
        if minutes_of(novice) >= task.minutes:
            break
    return TaskData(novice, _robot(task.expert), validation)


YARDSTICKS = {"mean": "the mean", "nothing_changes": "nothing changes"}


def card(task: Task, results: Sequence[EntryResult] = ()) -> str:
    """The robots, their sensors, how much motion, and the losses of two yardsticks."""
    expert, novice = bodies(task)
    whose = f"{task.expert} (expert) and {task.novice} (novice), recorded"
    if task.pair:
        whose = f"{task.pair}: its expert and its novice"
    amount = f"{task.expert_minutes:g} min" if task.expert_minutes else "all drives"
    lines = [
        task.name,
        f"  robots      {whose}",
        f"  novice      {_sensors(novice)}",
        f"  expert      {_sensors(expert) if expert != novice else 'the same'}",
        f"  motion      {task.minutes:g} min of the novice, {amount} of the expert",
        f"  predicted   {', '.join(novice.targets)}",
        f"  noise       {_noise(task)}",
    ]
    for method, name in YARDSTICKS.items():
        own = [r for r in results if (r.about.task, r.about.method) == (task, method)]
        losses = [r.loss for r in own if r.loss is not None]
        known = f"{np.mean(losses):.3g}" if losses else f"run 'bench {method}'"
        lines.append(f"  {name:16} loss {known}")
    return "\n".join(lines)


def _sensors(body: Body) -> str:
    """Columns, commands and map of a body."""
    columns = ", ".join(name for name, _ in body.columns)
    commands = ", ".join(name for name, _ in body.actions)
    ground = f", a height map of {body.map_size:g} m" if body.map_size else ""
    return f"{columns}{ground}; commands {commands}; pose {body.pose}"


def _noise(task: Task) -> str:
    """What no model can predict: the sensors' noise."""
    if task.pair:
        return "none: the simulator's states are exact"
    from companion.studies.real_robots import jitter
    from companion.studies.real_robots.measure import robot

    least, _ = jitter.floor(robot(task.novice)).loss
    return f"the jitter of the poses alone costs a loss of {least:.2g}"
