"""Seconds a sample: how long each method's training takes on one machine, in the same hour.

The seconds of a stored trial are also those of what ran beside it. Here the methods
take turns, round after round, so that a slow minute is nobody's in particular. Run as a
module it measures anew and writes `results/pace.json`.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from companion.engine.provenance import THREADS, here
from companion.engine.records import single
from companion.methods import BASELINES, FIGURE3, METHODS
from companion.study import Study
from companion.trials import Trial
from sidm.config import replace
from sidm.drives import STEPS
from sidm.storage import write_record

NAME = "pace.json"
SYSTEM = "system1"  # on the other one the same networks see batches of the same size
ROUNDS = 3
PRETRAINING = "novice_only"  # learns from one system alone, as a pretraining does
TRAINED = tuple(
    name
    for name in (*FIGURE3, *BASELINES)
    if name != "expert_only" and METHODS[name].fit == "gradients"
)  # that see samples of the novice


class Pace(NamedTuple):
    """Seconds of 1,000 samples in the rounds of a measurement."""

    median: float
    lowest: float
    highest: float


def timed(trial: Trial, data: str | Path) -> float:
    """Seconds of 1,000 samples of a trial's training, over one phase of each algorithm with its tests."""
    # brings PyTorch, which reading does without
    from companion.engine.execute import perform
    from sidm.learning.stopping import Tested

    training, events = trial.training, list[tuple[int, float]]()

    def note(tested: Tested) -> None:
        events.append((tested.samples, time.perf_counter()))

    iterations = training.test_interval + training.prediction_iterations
    most = iterations * training.batch * STEPS  # the clock starts at the first test
    perform(
        trial.replace(training=replace(training, max_samples=most, patience=most)),
        data,
        progress=note,
    )
    (first, start), (last, end) = events[0], events[-1]
    return 1000 * (end - start) / (last - first)


def measure(
    study: Study,
    results: Path,
    methods: Sequence[str] = TRAINED,
    rounds: int = ROUNDS,
    beside: str = "nothing else",
) -> None:
    """Time the methods on the smallest dataset of the baselines, and store what is found.

    Args:
        study: whose methods and data.
        results: the folder of the results.
        methods: names of `methods.METHODS`.
        rounds: how often each is timed.
        beside: what else the machine does meanwhile, in words.
    """
    minutes = study.preset.baseline_minutes[:1]
    trials = {
        name: study.points(SYSTEM, [name], minutes, seeds=1)[0] for name in methods
    }
    found: dict[str, list[float]] = {name: [] for name in methods}
    start = time.perf_counter()
    for _ in range(rounds):
        for name, trial in trials.items():
            found[name].append(float(f"{timed(trial, study.data):.6g}"))
    made = here(time.perf_counter() - start, THREADS, resumed=False)
    about = {
        name: getattr(made, name)
        for name in ("source", "python", "torch", "device", "threads", "date")
    }
    write_record(
        results / NAME,
        {"preset": study.preset.name, "seconds": found, "beside": beside, **about},
    )


def _stored(results: Path | str, preset: str) -> dict[str, Any]:
    """The record of a preset's measurement; empty without one."""
    values = single(Path(results) / NAME)
    return values if values.get("preset") == preset else {}


def read(results: Path | str, preset: str) -> dict[str, Pace]:
    """What is stored of a preset, by method; nothing where nothing is."""
    found = _stored(results, preset).get("seconds", {})
    return {
        name: Pace(float(np.median(some)), min(some), max(some))
        for name, some in found.items()
    }


def pace_note(results: Path | str, preset: str) -> str:
    """How a preset's paces were measured, or the command that does it."""
    found, command = (
        _stored(results, preset),
        f"`companion run --figure throughput --preset {preset}`",
    )
    if not found:
        return f"Seconds a sample are not measured for this preset; {command} does."
    rounds = len(next(iter(found["seconds"].values())))
    where = f"on one core ({found['device']}) beside {found['beside']}, {found['date'][:10]}"
    return f"Seconds of 1,000 samples in {rounds} rounds, {where}; again: {command}."


def seconds(frame: pd.DataFrame, paces: Mapping[str, Pace]) -> pd.Series:
    """What samples of trials and of their pretrainings take at the methods' median paces; NaN without a pace."""
    pace = {method: one.median / 1000 for method, one in paces.items()}
    own = frame.samples * frame.method.map(pace).astype(float)
    first = frame.pretraining_samples * pace.get(PRETRAINING, float("nan"))
    spent = own.where(frame.samples > 0, 0.0) + first.where(
        frame.pretraining_samples > 0, 0.0
    )
    return spent.where(frame.samples + frame.pretraining_samples > 0)


def make(study: Study, workers: int) -> None:
    """`companion run --figure throughput`, in one process."""
    measure(study, study.results, beside="what else it did, which was not said")
