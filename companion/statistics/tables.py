"""Tables of stored trials: what they cost, how they spread, which are stored."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pandas as pd

from companion.engine.store import Results
from companion.study import Study
from companion.trials import Trial
from sidm.body import Body

#: Name and unit of each of the 13 components of y.
COMPONENTS = (
    *((f"translation {axis}", "m") for axis in "xyz"),
    *((f"quaternion {axis}", "-") for axis in "xyzw"),
    *((f"linear velocity {axis}", "m/s") for axis in "xyz"),
    *((f"angular velocity {axis}", "rad/s") for axis in "xyz"),
)


def spread(frame: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """For each group that the columns `by` make: number of trials, mean, minimum and maximum of the loss."""
    found = (
        frame.groupby(list(by))
        .validation_loss.agg(["size", "mean", "min", "max"])
        .reset_index()
    )
    return found.rename(columns={"size": "trials", "min": "minimum", "max": "maximum"})


def wide(
    table: pd.DataFrame, rows: Sequence[str], columns: str, value: str
) -> pd.DataFrame:
    """A column for each of what `columns` holds, in their order; each of the `rows` has the words `value`, or a dash.

    Narrow cells break before a bracket, never in it.
    """
    unbroken = table.assign(
        **{value: table[value].astype(str).str.replace(", ", ",\N{NO-BREAK SPACE}")}
    )
    found = unbroken.pivot_table(
        value, list(rows), columns, aggfunc="first", sort=False, fill_value="-"
    )
    return found.reset_index()


def component_errors(losses: Mapping[str, Sequence[Sequence[float]]]) -> pd.DataFrame:
    """Root mean square error of each component of y, a line each with its unit, and the sum of squares.

    Args:
        losses: name of a column -> component losses (S, 13) of S trials, as
            `Outcome.component_losses`.
    """
    means = {
        name: np.mean(np.asarray(some, float), axis=0) for name, some in losses.items()
    }
    found = pd.DataFrame(COMPONENTS, columns=["component", "unit"]).assign(
        **{name: np.sqrt(mean) for name, mean in means.items()}
    )
    found.loc[len(found)] = [
        "**equation (1), sum of squares**",
        "",
        *(float(mean.sum()) for mean in means.values()),
    ]
    return found


def costs(frame: pd.DataFrame) -> pd.DataFrame:
    """What trials took, by system and method: mean and longest, min, and the most memory, MiB."""
    found = (
        frame.assign(minutes=frame.seconds / 60)
        .groupby(["system", "method"])
        .agg(
            trials=("seed", "size"),
            mean=("minutes", "mean"),
            longest=("minutes", "max"),
            memory=("peak_memory", "max"),
        )
        .reset_index()
    )
    names = {
        "mean": "mean (min)",
        "longest": "longest (min)",
        "memory": "peak memory (MiB)",
    }
    return found.assign(memory=found.memory.round().astype(int)).rename(columns=names)


def differences(trial: Trial, base: Trial) -> str:
    """What tells a trial's network and trainings from another's, as 'p_expert=0.25'; empty when nothing does."""
    words = []
    for part in ("network", "training", "pretraining"):
        one, other = getattr(trial, part), getattr(base, part)
        if one is not None and other is not None:
            names = [field.name for field in dataclasses.fields(one)]
            values = {
                n: getattr(one, n)
                for n in names
                if getattr(one, n) != getattr(other, n)
            }
            words += [
                f"{n}={v.name if isinstance(v, Body) else v}" for n, v in values.items()
            ]
    return ", ".join(dict.fromkeys(words))


def overview(store: Results, trials: Iterable[Trial], study: Study) -> list[str]:
    """A line a system, method, size and configuration: how many of a study's trials are stored and stale, mean loss."""
    points: dict[Trial, list[Trial]] = {}
    for trial in trials:
        points.setdefault(trial.replace(seed=0), []).append(trial)
    lines = []
    for first, group in points.items():
        rows = store.rows(group)
        words = f"{first.system}  {first.method:<18}{first.novice_minutes:>6g} min  stored {len(rows)} of {len(group)}"
        if rows:
            loss = np.mean([row.outcome.validation_loss for row in rows])
            words += (
                f"  stale {sum(row.provenance.stale for row in rows)}  loss {loss:.4g}"
            )
        variant = differences(
            first, study.trial(first.system, first.method, first.novice_minutes)
        )
        lines.append(words + (f"  ({variant})" if variant else ""))
    return lines
