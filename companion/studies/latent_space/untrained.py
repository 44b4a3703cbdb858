"""How far apart the latents of two robots are before any training.

An encoder for each robot draws its own initial weights, so the same physical situation
has two latents from the start. For comparison both robots also go through one encoder.

`companion run --figure untrained-latents` measures it and writes
`results/untrained_latents.json`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from companion.engine.records import read_or_empty
from companion.studies.latent_space.measure import jobs
from companion.study import Study
from companion.trials import Trial
from sidm.systems import PAPER_SYSTEMS

NAME = "untrained_latents.json"
#: Name in the file -> the role whose encoder the novice's motion goes through.
ENCODERS = {"own encoders": "novice", "one encoder": "expert"}


def measure(trial: Trial, data: Path) -> dict[str, tuple[float, float]]:
    """The latents of a trial's encoders with their initial weights, measured.

    For each of ENCODERS: the accuracy of a fresh small network on held-out steps, and
    the squared maximum mean discrepancy, as of a trained model. The novice's motion is
    the validation set, the expert's as many trajectories. No digest is asked for: any
    motion of the two robots will do.
    """
    # here, since stored measures are read without PyTorch
    from companion.engine.library import dataset_windows
    from companion.studies.latent_space.latents import (
        classifier_accuracy,
        latents_of,
        small_network,
        squared_mmd,
    )
    from sidm.learning.model import DynamicsModel
    from sidm.learning.units import Standardisation

    validation, expert = (
        dataset_windows(trial.datasets[kind], data, trial.network.pixels)
        for kind in ("validation", "expert")
    )
    model = DynamicsModel(trial.network, Standardisation.fit(expert), trial.seed)
    experts = latents_of(model, "expert", expert.take(range(len(validation))))
    apart = {}
    for name, role in ENCODERS.items():
        both = latents_of(model, role, validation), experts
        apart[name] = classifier_accuracy(both, small_network()), squared_mmd(*both)
    return apart


def make(study: Study, workers: int, data: Path, results: Path) -> dict[str, Any]:
    """Measure the latents of the paper's systems, in one process.

    The models are the SIDMs of the smallest size, one for each seed; all sizes start
    alike.
    """
    from sidm.learning.arithmetic import one_thread

    stored = {}
    with one_thread():
        for system in PAPER_SYSTEMS:
            trials = [trial for trial in jobs(study, system) if trial.method == "sidm"]
            least = min(trial.novice_minutes for trial in trials)
            smallest = [trial for trial in trials if trial.novice_minutes == least]
            seeds = [measure(trial, data) for trial in smallest]
            stored[system] = {
                name: [[round(value, 4) for value in seed[name]] for seed in seeds]
                for name in ENCODERS
            }
    return stored | {"preset": study.preset.name}


def table(results: Path | str, systems: Sequence[str]) -> pd.DataFrame:
    """The stored measures of some systems: a row for each of ENCODERS and seed.

    There are no rows if none are stored.
    """
    stored = read_or_empty(Path(results) / NAME)
    rows = [
        (name, *seed)
        for system in systems
        for name, seeds in stored.get(system, {}).items()
        for seed in seeds
    ]
    return pd.DataFrame(rows, columns=["encoders", "network_accuracy", "mmd"])
