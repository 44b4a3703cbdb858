"""Rows of the store as arrays, as a line that says where they come from, and as a table of what they cost."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from sidm.experiments.grids import COMPARED, METHODS
from sidm.experiments.presets import Preset
from sidm.experiments.store import Results, Row
from sidm.experiments.trials import Trial
from sidm.learning.settings import Training


class Losses(NamedTuple):
    """The part of a study that is complete: S seeds, K methods, M sizes."""

    minutes: np.ndarray  # (M,) rising
    values: np.ndarray  # (S, K, M)


def validation_loss(row: Row) -> float:
    """Equation (1) on the validation set."""
    return row.outcome.validation_loss


def final_position_error(row: Row) -> float:
    """Deviation at the end of the rollouts, m."""
    return row.outcome.position_error[-1]


def gather(
    rows: Iterable[Row],
    system: str,
    methods: Sequence[str] = COMPARED,
    value: Callable[[Row], float] = validation_loss,
) -> Losses:
    """A value of every row of a system as an array over seeds, methods and sizes.

    Sizes that a method lacks altogether are left out, then seeds that lack one of the sizes.
    """
    cells = {(r.trial.seed, r.trial.method, r.trial.novice_minutes): value(r) for r in rows if r.trial.system == system}
    sizes = sorted(set.intersection(*({size for _, method, size in cells if method == m} for m in methods)))
    every = sorted({seed for seed, _, _ in cells})
    seeds = [seed for seed in every if all((seed, m, size) in cells for m in methods for size in sizes)]
    values = [[[cells[seed, m, size] for size in sizes] for m in methods] for seed in seeds]
    return Losses(np.array(sizes, float), np.array(values, float).reshape(len(seeds), len(methods), len(sizes)))


def provenance_line(rows: Sequence[Row], command: str = "") -> str:
    """Under each result: trials, dates, code version, device, hours, and the `command` that makes it again."""
    if not rows:
        return "No trials stored" + (f"; `{command}` runs them." if command else ".")
    made = [row.provenance for row in rows]
    days = sorted({one.date[:10] for one in made})
    codes = sorted({f"{one.version} ({one.learning_source})" for one in made})
    stale = sum(row.stale for row in rows)
    parts = [
        f"{len(rows)} trials",
        " to ".join(dict.fromkeys((days[0], days[-1]))),
        f"code {', '.join(codes)}" + (f", {stale} of them made by older code" if stale else ""),
        f"{', '.join(sorted({one.device for one in made}))}, {sum(one.seconds for one in made) / 3600:.2g} h in all",
    ]
    return "; ".join(parts) + (f"; again: `{command}`." if command else ".")


class Cost(NamedTuple):
    """What the trials of one system and method took."""

    system: str
    method: str
    trials: int
    mean_minutes: float
    longest_minutes: float
    peak_memory: float  # MiB


def costs_table(rows: Sequence[Row]) -> list[Cost]:
    """Time and memory by system and method."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row.trial.system, row.trial.method), []).append(row)
    table = []
    for (system, method), group in sorted(groups.items()):
        minutes = [row.provenance.seconds / 60 for row in group]
        memory = max(row.provenance.peak_memory for row in group)
        table.append(Cost(system, method, len(group), float(np.mean(minutes)), max(minutes), memory))
    return table


def differences(training: Training, base: Training) -> str:
    """What tells a training from another, as 'p_expert=0.25'; empty when nothing does."""
    names = (field.name for field in dataclasses.fields(training))  # type: ignore[arg-type]
    return ", ".join(f"{n}={getattr(training, n)}" for n in names if getattr(training, n) != getattr(base, n))


def overview(store: Results, trials: Iterable[Trial], preset: Preset) -> list[str]:
    """A line a system, method, size and training: how many of the preset's trials are stored and stale, mean loss."""
    points: dict[tuple[str, str, float, Training], list[Trial]] = {}
    for trial in trials:
        points.setdefault((trial.system, trial.method, trial.novice_minutes, trial.training), []).append(trial)
    lines = []
    for (system, method, minutes, training), group in points.items():
        rows = store.rows(group)
        words = f"{system}  {method:<18}{minutes:>6g} min  stored {len(rows)} of {len(group)}"
        if rows:
            loss = np.mean([validation_loss(row) for row in rows])
            words += f"  stale {sum(row.stale for row in rows)}  loss {loss:.4g}"
        variant = differences(training, METHODS[method](preset, system))
        lines.append(words + (f"  ({variant})" if variant else ""))
    return lines
