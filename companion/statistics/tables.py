"""Tables of stored trials: what they cost, how losses vary, which are stored."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from companion.engine.frame import settings_of
from companion.engine.store import Results
from companion.study import Study
from companion.trials import Trial
from sidm.config import to_mapping

#: Name and unit of each of the 13 components of y.
COMPONENTS = (
    *((f"translation {axis}", "m") for axis in "xyz"),
    *((f"quaternion {axis}", "-") for axis in "xyzw"),
    *((f"linear velocity {axis}", "m/s") for axis in "xyz"),
    *((f"angular velocity {axis}", "rad/s") for axis in "xyz"),
)


def loss_summary(frame: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Number of trials, and mean, minimum and maximum of the loss, by group."""
    losses = frame.groupby(list(by)).validation_loss
    table = losses.agg(["size", "mean", "min", "max"]).reset_index()
    return table.rename(columns={"size": "trials", "min": "minimum", "max": "maximum"})


def wide(
    table: pd.DataFrame, rows: Sequence[str], columns: str, value: str
) -> pd.DataFrame:
    """A table in wide form: one column for each value of a column, in their order.

    Narrow cells break before a bracket, never inside it; an empty cell is a dash.
    """
    unbroken = (
        table[value]
        .astype(str)
        .str.replace(" to ", "\N{NO-BREAK SPACE}to\N{NO-BREAK SPACE}")
    )
    pivot = table.assign(**{value: unbroken}).pivot_table(
        value, list(rows), columns, aggfunc="first", sort=False, fill_value="-"
    )
    return pivot.reset_index()


def differences(trial: Trial, base: Trial) -> dict[str, tuple[Any, Any]]:
    """Settings of a trial that differ from another's: name -> its value and the other.

    Those of networks and training are among them; of a body there is the name.
    """
    values, others = (settings_of(to_mapping(one)) for one in (trial, base))
    return {
        name: (value, others[name])
        for name, value in values.items()
        if name in others and value != others[name]
    }


def overview(store: Results, trials: Iterable[Trial], study: Study) -> list[str]:
    """One line per system, method, size and configuration about its stored trials.

    It says how many are stored, how many of these are stale, and their mean loss.
    """
    points: dict[Trial, list[Trial]] = {}
    for trial in trials:
        points.setdefault(trial.replace(seed=0), []).append(trial)
    lines = []
    for first, group in points.items():
        rows = store.stored(group)
        line = (
            f"{first.system}  {first.method:<18}{first.novice_minutes:>6g} min"
            f"  stored {len(rows)} of {len(group)}"
        )
        if rows:
            loss = np.mean([row.outcome.validation_loss for row in rows])
            stale = sum(row.provenance.stale for row in rows)
            line += f"  stale {stale}  loss {loss:.4g}"
        default = study.trial(first.system, first.method, first.novice_minutes)
        changed = differences(first, default).items()
        variant = ", ".join(f"{name}={value}" for name, (value, _) in changed)
        lines.append(f"{line}  ({variant})" if variant else line)
    return lines
