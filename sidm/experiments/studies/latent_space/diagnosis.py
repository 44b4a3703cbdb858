"""How alike two systems' latent state-actions are: fresh domain classifiers, MMD, a picture.

`python -m sidm.experiments.studies.latent_space.diagnosis` trains the models anew, at the two sizes of the baselines
with and without regularisation, and stores what it finds in results/diagnostics; what is stored is not made again.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import importlib.metadata
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from sklearn.linear_model import LogisticRegression

from sidm.config import ConfigError, config, from_mapping
from sidm.experiments.engine.confirm import Confirmed, make_again
from sidm.experiments.engine.execute import Library, perform
from sidm.experiments.engine.provenance import THREADS, Provenance, here
from sidm.experiments.engine.store import StoreError, rounded
from sidm.experiments.presets import PRESETS, load_preset
from sidm.experiments.studies.latent_space.latents import (
    EVERY,
    crossed_loss,
    latents_of,
    picture,
    small_network,
    squared_mmd,
    told_apart,
)
from sidm.experiments.study import Study
from sidm.experiments.trials import Dataset, Trial
from sidm.learning.dataset import load_motion
from sidm.learning.model import DynamicsModel
from sidm.learning.training import Trained
from sidm.pool import local_pool
from sidm.progress import progress_bar
from sidm.storage import Damaged, read_record, write_record
from sidm.systems import ROLES, SYSTEMS, find_system

if TYPE_CHECKING:
    import pandas as pd

METHODS_COMPARED = ("sidm", "no_regularisation")


@config
class Diagnosis:
    """What the latents of a trained model are like; accuracies are shares of held-out steps, 0.5 by chance."""

    trial: Trial
    validation_loss: float  # of the model that was trained for it
    expert_encoder_loss: float  # of the novice's validation set through the expert's encoder and the novice's decoder
    expert_decoder_loss: float  # through the novice's encoder and the expert's decoder
    expert_path_loss: float  # through both of the expert's
    linear_accuracy: float  # of a logistic regression on the latents
    network_accuracy: float  # of a small network on them
    raw_accuracy: float  # of a small network on the raw states and actions, before any encoder
    a_distance: float  # proxy A-distance 2 (1 - 2 e), e the small network's error: 0 alike, 2 wholly apart
    discriminator_accuracy: float | None  # of the training's own, mean over the tests' last quarter; None without one
    mmd: float  # squared, unbiased, Gaussian kernel of the median distance; 0 alike
    novice_picture: tuple[tuple[float, float], ...]  # (PICTURED, 2) principal components of both's latents
    expert_picture: tuple[tuple[float, float], ...]
    scikit_learn: str  # its version
    provenance: Provenance

def diagnosed(study: Study, systems: Iterable[str] = tuple(SYSTEMS)) -> list[Trial]:
    """The trials whose latents are looked at: with and without regularisation, a small and a middle size."""
    return [
        trial for system in systems for trial in study.points(system, METHODS_COMPARED, study.preset.baseline_minutes)
    ]


def held_out_expert(trial: Trial) -> Dataset:
    """The expert's trajectories up to the last that is held out: as many more as validate the novice."""
    sets = trial.datasets
    return Dataset(collection=sets["expert"].collection, count=sets["expert"].count + sets["validation"].count)


def diagnose(trial: Trial, data: str | Path = "data") -> Diagnosis:
    """Train a trial's model and look at its latents on data that it has not seen.

    Raises:
        ConfigError: the trial's method has no expert.
        ShardError: data are missing; `run` collects the expert's that are held out.
    """
    if not trial.training.needs_expert:
        raise ConfigError(f"{trial}: its model has no expert whose latents could be compared")
    start = time.perf_counter()
    outcome, trained = perform(trial, data)
    assert isinstance(trained.model, DynamicsModel)  # it has an expert, so it corrects none
    more = held_out_expert(trial)
    terrain, pixels = find_system(trial.system).terrain, trial.network.pixels
    expert = load_motion(data, more.collection, more.count, terrain, pixels)
    held_out = expert.part(range(trial.datasets["expert"].count, more.count))
    novice = Library(data).motion(trial, "validation")
    motions = novice, held_out.take(range(len(held_out)))
    latents = [latents_of(trained.model, role, m) for role, m in zip(ROLES, motions, strict=True)]
    raw = [motion.inputs[:, ::EVERY].double().numpy() for motion in motions]
    pictures = picture(*latents)
    network = told_apart(latents, small_network())
    return Diagnosis(
        trial=trial,
        validation_loss=outcome.validation_loss,
        expert_encoder_loss=crossed_loss(trained.model, novice, "expert", "novice"),
        expert_decoder_loss=crossed_loss(trained.model, novice, "novice", "expert"),
        expert_path_loss=crossed_loss(trained.model, novice, "expert", "expert"),
        linear_accuracy=told_apart(latents, LogisticRegression(max_iter=1000)),
        network_accuracy=network,
        raw_accuracy=told_apart(raw, small_network()),
        a_distance=max(0.0, 2 * (2 * network - 1)),
        discriminator_accuracy=_last_accuracy(trained),
        mmd=squared_mmd(*latents),
        novice_picture=pictures[0],
        expert_picture=pictures[1],
        scikit_learn=importlib.metadata.version("scikit-learn"),
        provenance=here(time.perf_counter() - start, THREADS, kind="diagnosis"),
    )


def _last_accuracy(trained: Trained) -> float | None:
    """What share of latents the training's discriminator told apart towards the end."""
    late = trained.history[3 * len(trained.history) // 4 :]
    known = [test.discriminator_accuracy for test in late if test.discriminator_accuracy is not None]
    return float(np.mean(known)) if known else None


def path(trial: Trial, results: str | Path = "results") -> Path:
    """Where a trial's diagnosis is stored, whether it is or not."""
    return Path(results) / "diagnostics" / f"{trial.key}.json"


def write(found: Diagnosis, results: str | Path = "results") -> None:
    """Store a diagnosis."""
    write_record(path(found.trial, results), rounded(dataclasses.asdict(found)))  # type: ignore[call-overload]


def read(trial: Trial, results: str | Path = "results") -> Diagnosis | None:
    """The stored diagnosis of a trial, None where there is none; StoreError when it is damaged."""
    try:
        found = from_mapping(Diagnosis, read_record(path(trial, results)))
    except FileNotFoundError:
        return None
    except (Damaged, ConfigError, TypeError) as error:
        raise StoreError(f"{path(trial, results)}: damaged ({error}); delete it and diagnose again") from None
    return found


def run(
    trials: Sequence[Trial],
    executor: Executor,
    data: str | Path = "data",
    results: str | Path = "results",
    progress: bool = True,
) -> None:
    """Diagnose the trials that are not yet diagnosed, each stored as soon as it is done."""
    from sidm.simulation import collect

    missing = [trial for trial in trials if read(trial, results) is None]
    for held_out in {held_out_expert(trial) for trial in missing}:
        collect(Path(data), held_out.collection, held_out.count, executor=executor, progress=progress)
    futures = [executor.submit(diagnose, trial, Path(data).absolute()) for trial in missing]
    with progress_bar(len(missing), "diagnoses", "trial", progress) as bar:
        for done in as_completed(futures):
            write(done.result(), results)
            bar.update()


POINT = ["system", "novice_minutes", "method"]
ALIKE = ("linear_accuracy", "network_accuracy", "raw_accuracy", "a_distance", "mmd", "discriminator_accuracy")
CROSSED = ("validation_loss", "expert_encoder_loss", "expert_decoder_loss", "expert_path_loss")


def confirm_diagnoses(
    trials: Iterable[Trial], results: Path, executor: Executor, data: str | Path = "data", progress: bool = True
) -> Confirmed:
    """`confirm` of the stored diagnoses of `trials` under `results`."""
    stored = [found for found in (read(trial, results) for trial in trials) if found is not None]
    work = functools.partial(diagnose, data=Path(data).absolute())
    return make_again(stored, executor, work, functools.partial(write, results=results), progress)


def frame(found: Sequence[Diagnosis]) -> pd.DataFrame:
    """Diagnoses as a table, a row a model: its `system`, `novice_minutes`, `method` and `seed`, and the measures."""
    import pandas as pd

    lines = [
        {name: getattr(one.trial, name) for name in ("system", "novice_minutes", "method", "seed")}
        | {name: getattr(one, name) for name in (*CROSSED, *ALIKE)}
        for one in found
    ]
    return pd.DataFrame(lines, columns=[*POINT, "seed", *dict.fromkeys((*CROSSED, *ALIKE))])


def table(frame: pd.DataFrame, measures: Sequence[str]) -> pd.DataFrame:
    """Number of models and means of some measures by system, size and method."""
    groups = frame.astype({name: float for name in measures}).groupby(POINT)
    found = groups[list(measures)].mean()
    found.insert(0, "trials", groups.size())
    return found.reset_index()


def main() -> None:
    """Diagnose a preset's trials."""
    parser = argparse.ArgumentParser(description="Look at the latent spaces of trained models.")
    parser.add_argument("--preset", choices=PRESETS, default="laptop", help="whose trials (%(default)s)")
    parser.add_argument("--data", type=Path, default=Path("data"), help="trajectories (%(default)s)")
    parser.add_argument("--results", type=Path, default=Path("results"), help="the results store (%(default)s)")
    parser.add_argument("--workers", type=int, default=2, help="processes of one thread each (%(default)s)")
    given = parser.parse_args()
    study = Study(load_preset(given.preset), given.data, given.results)
    with local_pool(given.workers) as pool:
        run(diagnosed(study), pool, given.data, given.results)


if __name__ == "__main__":
    main()
