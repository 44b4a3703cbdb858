"""Predictions beside what was recorded, as tables whose columns have their units."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import pandas as pd

from ownrobot.fitting.windows import Steps, part_of, rollouts
from sidm.body import SI, Body, Columns
from sidm.drives import Drive
from sidm.learning.model import Predictor
from sidm.learning.observation import QUATERNION


def one_step_table(drives: Sequence[Drive], steps: Sequence[Steps]) -> pd.DataFrame:
    """A row for each step of the drives, of transitions (K, Y) of each drive."""
    body = drives[0].body
    # A pose has the same units as its change, which is what the model predicts.
    units = [unit for _, unit in body.state]
    columns = tuple(zip(body.targets, units, strict=True))
    tables = []
    for drive, (predicted, actual) in zip(drives, steps, strict=True):
        time = np.arange(1, len(drive) + 1) / body.rate
        table = pd.DataFrame({"drive": drive.name, "time [s]": time})
        values = (predicted.numpy(), actual.numpy())
        tables.append(pd.concat([table, _side_by_side(columns, *values)], axis=1))
    return pd.concat(tables, ignore_index=True)


def open_loop_table(
    predictor: Predictor,
    drives: Sequence[Drive],
    steps: int,
    every: int | None,
    seen: int,
    pixels: int,
) -> pd.DataFrame:
    """A row for each of `steps` predicted steps of each start.

    Starts are `every` so many steps, or the drives' starts alone; a model first sees at
    most `seen` steps before a start.
    """
    starts = [
        (number, start)
        for number, drive in enumerate(drives)
        for start in range(0, len(drive), every or len(drive))
    ]
    groups = defaultdict(list)  # starts of equal windows make a batch
    for number, start in starts:
        ahead = min(steps, len(drives[number]) - start)
        groups[min(start, seen), ahead].append((number, start))
    tables = {}
    for (before, ahead), members in groups.items():
        parts = [part_of(drives[n], s - before, s + ahead) for n, s in members]
        paths = rollouts(predictor, parts, before, ahead, pixels)
        for (number, start), part, path in zip(members, parts, paths, strict=True):
            body, actual = part.body, part.states[before + 1 :]
            time = (start + np.arange(1, ahead + 1)) / body.rate
            table = pd.DataFrame(
                {
                    "drive": part.name,
                    "start [s]": start / body.rate,
                    "time [s]": time,
                }
            )
            predicted = _nearest_turn(path[1:].numpy(), actual, body)
            values = _side_by_side(body.state, predicted, actual)
            tables[number, start] = pd.concat([table, values], axis=1)
    return pd.concat([tables[key] for key in starts], ignore_index=True)


def _nearest_turn(states: np.ndarray, actual: np.ndarray, body: Body) -> np.ndarray:
    """States (K, S) with the yaw, or the quaternion's sign, nearest to the actual."""
    states = states.copy()
    if body.pose == "planar":
        turns = np.round((actual[:, 2] - states[:, 2]) / (2 * np.pi))
        states[:, 2] += 2 * np.pi * turns
    elif body.pose == "spatial":
        products = states[:, QUATERNION] * actual[:, QUATERNION]
        states[products.sum(1) < 0, QUATERNION] *= -1
    return states


def _side_by_side(
    columns: Columns, predicted: np.ndarray, actual: np.ndarray
) -> pd.DataFrame:
    """Predicted and actual values (K, C) of columns, with names and units."""
    titles = [f"{name} [{SI.get(unit, unit)}]" for name, unit in columns]
    return pd.DataFrame(
        {
            f"{kind} {title}": values[:, number]
            for kind, values in (("predicted", predicted), ("actual", actual))
            for number, title in enumerate(titles)
        }
    )
