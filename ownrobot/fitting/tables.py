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
    units = (unit for _, unit in body.state)
    columns = tuple(zip(body.targets, units, strict=True))
    tables = []
    for drive, (predicted, actual) in zip(drives, steps, strict=True):
        about = {"drive": drive.name, "time [s]": _times(0, len(drive), body)}
        tables.append(_table(about, columns, predicted.numpy(), actual.numpy()))
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
    body = drives[0].body
    groups = defaultdict(list)  # starts of equal windows make a batch
    for number, drive in enumerate(drives):
        for start in range(0, len(drive), every or len(drive)):
            ahead = min(steps, len(drive) - start)
            groups[min(start, seen), ahead].append((number, start))
    tables = {}
    for (before, ahead), members in groups.items():
        parts = [part_of(drives[n], s - before, s + ahead) for n, s in members]
        paths = rollouts(predictor, parts, before, ahead, pixels)
        for (number, start), part, path in zip(members, parts, paths, strict=True):
            about = {"drive": part.name, "start [s]": start / body.rate}
            about["time [s]"] = _times(start, ahead, body)
            actual = part.states[before + 1 :]
            predicted = _nearest_turn(path[1:].numpy(), actual, body)
            tables[number, start] = _table(about, body.state, predicted, actual)
    return pd.concat([tables[key] for key in sorted(tables)], ignore_index=True)


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


def _times(start: int, count: int, body: Body) -> np.ndarray:
    """Times (K,), s, of the ends of `count` steps from step `start`."""
    return (start + np.arange(1, count + 1)) / body.rate


def _table(
    about: dict, columns: Columns, predicted: np.ndarray, actual: np.ndarray
) -> pd.DataFrame:
    """Predicted and actual values (K, C) of columns, with names and units."""
    values = {
        f"{kind} {name} [{SI.get(unit, unit)}]": numbers[:, column]
        for kind, numbers in (("predicted", predicted), ("actual", actual))
        for column, (name, unit) in enumerate(columns)
    }
    return pd.DataFrame(about | values)
