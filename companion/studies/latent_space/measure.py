"""How alike two systems' latent state-actions are: classifiers, MMD, a picture.

`companion run --figure latent-space` trains the models again, at the two sizes of the
baselines with and without regularisation, and stores the diagnoses in
results/latent_space.jsonl.
"""

from __future__ import annotations

import importlib.metadata
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from companion.engine.provenance import Provenance
from companion.engine.records import ProvenanceTimer, records_of
from companion.study import Study
from companion.trials import Dataset, Trial, motion_of
from sidm.config import ConfigError, config
from sidm.systems import ROLES

METHODS_COMPARED = ("sidm", "no_regularisation")


@config
class Diagnosis:
    """Measures of a trained model's latents.

    Accuracies are shares of held-out steps, 0.5 by chance.
    """

    about: Trial  # the trial whose model is measured
    validation_loss: float  # of the model that was trained for these measures
    #: equation (1) on the novice's validation set, with the expert's encoder and the
    #: novice's decoder
    expert_encoder_loss: float
    expert_decoder_loss: float  # with the novice's encoder and the expert's decoder
    expert_path_loss: float  # with the expert's encoder and decoder
    linear_accuracy: float  # of a logistic regression on the latents
    network_accuracy: float  # of a small network on the latents
    #: of a small network on the raw states and actions, before any encoder
    raw_accuracy: float
    #: proxy A-distance 2 (1 - 2 e), e the small network's error: 0 alike, 2 wholly
    #: apart
    a_distance: float
    #: of the discriminator of the training, mean over the last quarter of the tests;
    #: None without a discriminator
    discriminator_accuracy: float | None
    mmd: float  # squared, unbiased, Gaussian kernel of the median distance; 0 alike
    #: (PICTURED, 2) principal components of the novice's latents
    novice_picture: tuple[tuple[float, float], ...]
    #: (PICTURED, 2) principal components of the expert's latents
    expert_picture: tuple[tuple[float, float], ...]
    scikit_learn: str  # version of scikit-learn
    provenance: Provenance


#: the stored results, under a folder of results
records = records_of(Diagnosis, "latent-space")


def jobs(study: Study, system: str) -> list[Trial]:
    """Trials with and without regularisation, of a small and a middle size."""
    return study.points(system, METHODS_COMPARED, study.preset.baseline_minutes)


def held_out_expert(trial: Trial) -> Dataset:
    """The expert's training motion, and as many trajectories as validate the novice."""
    expert, validation = (trial.datasets[kind] for kind in ("expert", "validation"))
    return Dataset(collection=expert.collection, count=expert.count + validation.count)


def motion(trial: Trial) -> dict[Dataset, Sequence[int]]:
    """The motion that a job needs, the held-out motion of the expert included."""
    held_out = held_out_expert(trial)
    return {**motion_of([trial]), held_out: range(held_out.count)}


def measure(trial: Trial, data: str | Path = "data") -> Diagnosis:
    """Train a trial's model and measure its latents on unseen motion.

    ConfigError says that the trial's method has no expert, ShardError that data are
    missing.
    """
    # here, since stored diagnoses are read without PyTorch
    from sklearn.linear_model import LogisticRegression

    from companion.engine.execute import perform
    from companion.engine.library import Library, dataset_windows
    from companion.studies.latent_space.latents import (
        STRIDE,
        classifier_accuracy,
        crossed_loss,
        latents_of,
        picture,
        small_network,
        squared_mmd,
    )
    from sidm.learning.model import DynamicsModel

    if not trial.training.needs_expert:
        raise ConfigError(
            f"{trial}: its model has no expert whose latents could be compared"
        )
    timer = ProvenanceTimer("diagnosis", trial, data)
    outcome, trained = perform(trial, data)
    model = trained.model
    # a model with an expert is no correction of the expert's model
    assert isinstance(model, DynamicsModel)
    dataset = held_out_expert(trial)
    expert = dataset_windows(dataset, data, trial.network.pixels)
    held_out = expert.subset(range(trial.datasets["expert"].count, dataset.count))
    novice = Library(data).motion(trial, "validation")
    motions = novice, held_out.take(range(len(held_out)))
    latents = [latents_of(model, *side) for side in zip(ROLES, motions, strict=True)]
    raw = [motion.inputs[:, ::STRIDE].double().numpy() for motion in motions]
    pictures = picture(*latents)
    accuracy = classifier_accuracy(latents, small_network())
    # of the discriminator over the last quarter of the tests
    late = trained.history[3 * len(trained.history) // 4 :]
    own = [test.discriminator_accuracy for test in late]
    known = [share for share in own if share is not None]
    return Diagnosis(
        about=trial,
        validation_loss=outcome.validation_loss,
        expert_encoder_loss=crossed_loss(model, novice, "expert", "novice"),
        expert_decoder_loss=crossed_loss(model, novice, "novice", "expert"),
        expert_path_loss=crossed_loss(model, novice, "expert", "expert"),
        linear_accuracy=classifier_accuracy(latents, LogisticRegression(max_iter=1000)),
        network_accuracy=accuracy,
        raw_accuracy=classifier_accuracy(raw, small_network()),
        a_distance=max(0.0, 2 * (2 * accuracy - 1)),
        discriminator_accuracy=float(np.mean(known)) if known else None,
        mmd=squared_mmd(*latents),
        novice_picture=pictures[0],
        expert_picture=pictures[1],
        scikit_learn=importlib.metadata.version("scikit-learn"),
        provenance=timer.done(),
    )
