"""How alike two systems' latent state-actions are: fresh domain classifiers, MMD, a picture.

`companion run --figure latent-space` trains the models again, at the two sizes of the
baselines with and without regularisation, and keeps what it finds in
results/latent_space.
"""

from __future__ import annotations

import importlib.metadata
from concurrent.futures import Executor
from pathlib import Path

import numpy as np
from sklearn.linear_model import LogisticRegression

from companion.engine.datasets import collect_dataset
from companion.engine.execute import Library, perform
from companion.engine.provenance import Provenance
from companion.engine.records import Making, records_of
from companion.studies.latent_space.latents import (
    EVERY,
    crossed_loss,
    latents_of,
    picture,
    small_network,
    squared_mmd,
    told_apart,
)
from companion.study import Study
from companion.trials import Dataset, Trial
from sidm.config import ConfigError, config
from sidm.learning.dataset import load_windows
from sidm.learning.model import DynamicsModel
from sidm.learning.training import Trained
from sidm.systems import ROLES, find_system

METHODS_COMPARED = ("sidm", "no_regularisation")


@config
class Diagnosis:
    """What the latents of a trained model are like; accuracies are shares of held-out steps, 0.5 by chance."""

    about: Trial  # whose model
    validation_loss: float  # of the model that was trained for it
    #: of the novice's validation set through the expert's encoder and the novice's
    #: decoder
    expert_encoder_loss: float
    expert_decoder_loss: float  # through the novice's encoder and the expert's decoder
    expert_path_loss: float  # through both of the expert's
    linear_accuracy: float  # of a logistic regression on the latents
    network_accuracy: float  # of a small network on them
    #: of a small network on the raw states and actions, before any encoder
    raw_accuracy: float
    #: proxy A-distance 2 (1 - 2 e), e the small network's error: 0 alike, 2 wholly
    #: apart
    a_distance: float
    #: of the training's own, mean over the tests' last quarter; None without one
    discriminator_accuracy: float | None
    mmd: float  # squared, unbiased, Gaussian kernel of the median distance; 0 alike
    #: (PICTURED, 2) principal components of both's latents
    novice_picture: tuple[tuple[float, float], ...]
    expert_picture: tuple[tuple[float, float], ...]
    scikit_learn: str  # its version
    provenance: Provenance


#: where they are kept, under a folder of results
records = records_of(Diagnosis, "latent-space")


def jobs(study: Study, system: str) -> list[Trial]:
    """The trials whose latents are looked at: with and without regularisation, a small and a middle size."""
    return study.points(system, METHODS_COMPARED, study.preset.baseline_minutes)


def held_out_expert(trial: Trial) -> Dataset:
    """The expert's trajectories up to the last that is held out: as many more as validate the novice."""
    sets = trial.datasets
    return Dataset(
        collection=sets["expert"].collection,
        count=sets["expert"].count + sets["validation"].count,
    )


def collect_held_out(
    study: Study, system: str, executor: Executor | None = None
) -> None:
    """Simulate what is missing of the expert's that are held out."""
    for dataset in {held_out_expert(trial) for trial in jobs(study, system)}:
        collect_dataset(dataset, study.data, executor)


def measure(trial: Trial, data: str | Path = "data") -> Diagnosis:
    """Train a trial's model and look at its latents on data that it has not seen.

    Raises:
        ConfigError: the trial's method has no expert.
        ShardError: data are missing.
    """
    if not trial.training.needs_expert:
        raise ConfigError(
            f"{trial}: its model has no expert whose latents could be compared"
        )
    making = Making("diagnosis", trial, data)
    outcome, trained = perform(trial, data)
    # it has an expert, so it corrects none
    assert isinstance(trained.model, DynamicsModel)
    more = held_out_expert(trial)
    terrain, pixels = find_system(trial.system).terrain, trial.network.pixels
    expert = load_windows(data, more.collection, more.count, terrain, pixels)
    held_out = expert.subset(range(trial.datasets["expert"].count, more.count))
    novice = Library(data).motion(trial, "validation")
    motions = novice, held_out.take(range(len(held_out)))
    latents = [
        latents_of(trained.model, role, m)
        for role, m in zip(ROLES, motions, strict=True)
    ]
    raw = [motion.inputs[:, ::EVERY].double().numpy() for motion in motions]
    pictures = picture(*latents)
    network = told_apart(latents, small_network())
    return Diagnosis(
        about=trial,
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
        provenance=making.done(),
    )


def _last_accuracy(trained: Trained) -> float | None:
    """What share of latents the training's discriminator told apart towards the end."""
    late = trained.history[3 * len(trained.history) // 4 :]
    known = [
        test.discriminator_accuracy
        for test in late
        if test.discriminator_accuracy is not None
    ]
    return float(np.mean(known)) if known else None
