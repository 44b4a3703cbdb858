"""Seconds per sample: how long each method's training takes on one machine.

The seconds of a stored trial depend on what else ran at that time. Here all methods are
timed in turns, several rounds in the same hour, so that a slow minute falls on no
method in particular.

`companion run --figure throughput` measures it and writes `results/pace.json`.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from companion.engine.provenance import THREADS, record_provenance
from companion.engine.records import read_or_empty
from companion.methods import BASELINES, FIGURE3, METHODS
from companion.study import Study
from companion.trials import Trial
from sidm.config import replace
from sidm.drives import STEPS

NAME = "pace.json"
SYSTEM = "system1"  # system2 has the same networks and batches of the same size
ROUNDS = 3
PRETRAINING = "novice_only"  # learns from one system alone, as a pretraining does
#: Methods that train by gradients on samples of the novice.
TRAINED = tuple(
    name
    for name in (*FIGURE3, *BASELINES)
    if name != "expert_only" and METHODS[name].fit == "gradients"
)


def time_training(trial: Trial, data: str | Path) -> float:
    """Seconds per 1,000 samples of a trial's training.

    Timed are one phase of each algorithm and the tests of the loss between them.
    """
    # these import PyTorch, which `read` does not need
    from companion.engine.execute import perform
    from sidm.learning.stopping import CurvePoint

    training, events = trial.training, list[tuple[int, float]]()

    def note(point: CurvePoint) -> None:
        events.append((point.samples, time.perf_counter()))

    # the clock starts at the first test
    iterations = training.test_interval + training.prediction_iterations
    most = iterations * training.batch * STEPS
    short = replace(training, max_samples=most, patience=most)
    perform(trial.replace(training=short), data, progress=note)
    (first, start), (last, end) = events[0], events[-1]
    return 1000 * (end - start) / (last - first)


def make(study: Study, workers: int, data: Path, results: Path) -> dict[str, Any]:
    """Time the methods on the smallest dataset of the baselines, in one process.

    What else the machine does at the same time is not known.
    """
    minutes = study.preset.baseline_minutes[:1]
    trials = {
        name: study.points(SYSTEM, [name], minutes, seeds=1)[0] for name in TRAINED
    }
    times: dict[str, list[float]] = {name: [] for name in TRAINED}
    start = time.perf_counter()
    for _ in range(ROUNDS):
        for name, trial in trials.items():
            times[name].append(float(f"{time_training(trial, data):.6g}"))
    made = record_provenance(time.perf_counter() - start, THREADS, resumed=False)
    names = ("source", "python", "torch", "device", "threads", "date")
    provenance = {name: getattr(made, name) for name in names}
    beside = "what else it did, which was not said"
    record = {"preset": study.preset.name, "seconds": times, "beside": beside}
    return record | provenance


def _stored(results: Path | str, preset: str) -> dict[str, Any]:
    values = read_or_empty(Path(results) / NAME)
    return values if values.get("preset") == preset else {}


def read(results: Path | str, preset: str) -> dict[str, float]:
    """Seconds per 1,000 samples of a preset's methods, the median of the rounds."""
    times = _stored(results, preset).get("seconds", {})
    return {name: float(np.median(rounds)) for name, rounds in times.items()}


def pace_note(results: Path | str, preset: str, command: str) -> str:
    """How a preset's paces were measured, or the command that measures them."""
    stored = _stored(results, preset)
    if not stored:
        return f"Seconds a sample are not measured for this preset; `{command}` does."
    rounds = len(next(iter(stored["seconds"].values())))
    return (
        f"Seconds of 1,000 samples in {rounds} rounds, on one core "
        f"({stored['device']}) beside {stored['beside']}, {stored['date'][:10]}; "
        f"again: `{command}`."
    )


def seconds(frame: pd.DataFrame, paces: Mapping[str, float]) -> pd.Series:
    """Seconds for the samples of trials and their pretrainings at the paces of `read`.

    NaN where a method has no pace.
    """
    pace = {method: thousand / 1000 for method, thousand in paces.items()}
    training = frame.samples * frame.method.map(pace).astype(float)
    pretraining = frame.pretraining_samples * pace.get(PRETRAINING, float("nan"))
    spent = training.where(frame.samples > 0, 0.0)
    spent += pretraining.where(frame.pretraining_samples > 0, 0.0)
    return spent.where(frame.samples + frame.pretraining_samples > 0)
