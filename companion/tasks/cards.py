"""Cards of the tasks: what each is about, in a few lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from companion.bodies import NOVICES
from companion.tasks.catalogue import Task, recorded_body
from companion.tasks.trial import EntryResult
from sidm.body import ROVER, Body

YARDSTICKS = {"mean": "the mean", "nothing_changes": "nothing changes"}


def card(task: Task, results: Sequence[EntryResult] = ()) -> str:
    """The robots, their sensors, how much motion, and the losses of two yardsticks."""
    expert, novice = bodies(task)
    whose = (
        f"{task.pair}: its expert and its novice"
        if task.pair
        else (f"{task.expert} (expert) and {task.novice} (novice), recorded")
    )
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
        losses = [
            r.loss
            for r in results
            if (r.about.task, r.about.method) == (task, method) and r.loss is not None
        ]
        known = f"{np.mean(losses):.3g}" if losses else f"run 'bench {method}'"
        lines.append(f"  {name:16} loss {known}")
    return "\n".join(lines)


def bodies(task: Task) -> tuple[Body, Body]:
    """The bodies of the expert and of the novice."""
    if not task.pair:
        body = recorded_body()
        return body, body
    return ROVER, ROVER if task.novice == "rover" else NOVICES[task.novice]


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
