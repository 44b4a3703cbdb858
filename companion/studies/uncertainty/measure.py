"""Training by likelihood beside its deterministic twin (section 3.2, last paragraph).

`companion run --figure uncertainty` makes the results that are not stored in
results/uncertainty.jsonl yet.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from companion.engine.execute import model_of
from companion.engine.library import Library
from companion.engine.outcomes import ROLLOUT_STEPS, as_lists, curve, evaluate
from companion.engine.provenance import Provenance
from companion.engine.records import ProvenanceTimer, records_of
from companion.extensions.distributions import (
    MIN_LOG_STD,
    ConstantSpread,
    DistributionModel,
    StochasticPredictor,
    train_distributions,
)
from companion.extensions.particles import (
    DRAWS,
    LEVELS,
    PathCoverage,
    one_step,
    particle_rollout,
    path_coverage,
)
from companion.methods import COMPARED
from companion.study import Study
from companion.trials import Trial
from sidm.config import config
from sidm.learning.arithmetic import one_thread
from sidm.learning.dataset import Windows
from sidm.learning.evaluation import EVALUATION_BATCH, validation_loss
from sidm.learning.model import Predictor
from sidm.learning.seeds import generator
from sidm.learning.units import Standardisation

SIZES = (1.0, 5.0, 60.0)  # novice data, min
PARTICLES = 64  # of a rollout
#: The fields on the training of a twin; its trial has them instead.
UNTRAINED: dict[str, Any] = dict.fromkeys(
    ("samples", "best_samples", "best_test_loss", "training_seconds"), 0
) | (dict.fromkeys(("curve_samples", "curve_test_loss", "curve_training_loss"), ()))
#: The fields on the latents of a twin, which has none.
NO_LATENTS: dict[str, Any] = {
    "latent_spread": (0.0, 0.0),
    "quietest": (0.0, 0.0, 0.0),
}


@config
class Fit:
    """A model whose certainty is measured."""

    #: of the deterministic twin; the model by likelihood differs from it in its loss
    #: alone
    trial: Trial
    #: whether the model is trained by likelihood; otherwise it is the twin, with a
    #: constant spread
    likelihood: bool
    particles: int


@config
class FitResult:
    """Results of a Fit, with L levels of intervals, K steps and three directions.

    The directions are forward, m, sideways, m, and heading, rad. Values are on the
    validation set unless said otherwise. The fields on the training are 0 and empty for
    a twin, whose trial has them.
    """

    about: Fit
    #: equation (1) of the mean transitions that follow from the means of the latents
    validation_loss: float
    component_losses: tuple[float, ...]  # (13,) components of the validation loss
    nll: float  # nats a step, of the mixture over samples of the latents
    nll_at_means: float  # nats a step, with the latents at their means
    #: QUANTILES of `companion.extensions.particles`, of single steps' mixtures
    nll_quantiles: tuple[float, ...]
    component_nll: tuple[float, ...]  # (13,) of each component alone
    #: (13,) mean standard deviation given the latents, raw units
    spread: tuple[float, ...]
    #: of encoder and SIDM: mean predicted standard deviation divided by the standard
    #: deviation of the predicted means; 0 of a twin
    latent_spread: tuple[float, ...]
    #: of encoder, SIDM and decoder: share of standard deviations at their lower bound;
    #: 0 of a twin
    quietest: tuple[float, ...]
    coverage: tuple[tuple[float, ...], ...]  # (L, 13) of one step
    #: (L, K, 3) along rollouts
    steps_coverage: tuple[tuple[tuple[float, ...], ...], ...]
    #: (L, K, 3) width of the intervals, mean over the rollouts
    steps_width: tuple[tuple[tuple[float, ...], ...], ...]
    #: (K, 3) error of the particles' mean, mean over the rollouts
    steps_error: tuple[tuple[float, ...], ...]
    position_error: tuple[float, ...]  # (K,) m, of rollouts of the means
    heading_error: tuple[float, ...]  # (K,) rad, of rollouts of the means
    samples: int  # seen by prediction training
    best_samples: int  # seen until the weights that were kept
    best_test_loss: float  # smoothed negative log-likelihood
    curve_samples: tuple[int, ...]  # of at most 40 of the tests
    curve_test_loss: tuple[float, ...]
    curve_training_loss: tuple[float, ...]
    training_seconds: float
    provenance: Provenance


#: the stored results, under a folder of results
records = records_of(FitResult, "uncertainty")


def jobs(
    study: Study,
    system: str,
    sizes: Iterable[float] = SIZES,
    particles: int = PARTICLES,
) -> list[Fit]:
    """Models with and without SIDM, by likelihood and as twins, by size and seed."""
    available = study.preset.sizes_in_pool(system, sizes)
    trials = study.points(system, COMPARED, available)
    return [
        Fit(trial=trial, likelihood=likelihood, particles=particles)
        for trial in trials
        for likelihood in (True, False)
    ]


def measure(about: Fit, data: str | Path = "data") -> FitResult:
    """Train and evaluate a model."""
    timer, trial = ProvenanceTimer("uncertainty", about.trial, data), about.trial
    training, latents = UNTRAINED, NO_LATENTS
    with one_thread():
        library = Library(data)
        sets = library.datasets(trial)
        if about.likelihood:
            start = time.perf_counter()
            assert sets.expert is not None
            units = Standardisation.fit(sets.expert)
            trained = train_distributions(
                sets, trial.network, trial.training, trial.seed, units
            )
            training = {
                "samples": trained.samples,
                "best_samples": trained.best_samples,
                "training_seconds": time.perf_counter() - start,
                "best_test_loss": float(trained.best_test_loss),
                **curve(trained),
            }
            model = trained.model
            assert isinstance(model, DistributionModel)
            predictor: Predictor = model
            spread: StochasticPredictor = model
            latents = latent_fields(model, sets.validation)
        else:
            predictor = twin = model_of(trial, data)
            # errors on the test split, from which no weights have learned
            errors = validation_loss(twin, sets.test).float().sqrt().clamp_min(1e-6)
            spread = ConstantSpread(twin, errors)
        draws = DRAWS if about.likelihood else 1
        motion = library.motion(trial, "validation")
        rng = generator(trial.seed, "validation")
        step = one_step(spread, motion, rng, draws)
        at_means = one_step(spread, motion, None, 1)
        paths = rollout_coverage(spread, trial, library, about.particles)
        means = evaluate(predictor, trial, library)
    return FitResult(
        about=about,
        validation_loss=float(means.losses.sum()),
        component_losses=as_lists(means.losses),
        **step._asdict(),
        nll_at_means=at_means.nll,
        steps_coverage=as_lists(paths.inside),
        steps_width=as_lists(paths.width),
        steps_error=as_lists(paths.error),
        position_error=as_lists(means.position),
        heading_error=as_lists(means.heading),
        **latents,
        **training,
        provenance=timer.done(),
    )


def latent_fields(model: DistributionModel, motion: Windows) -> dict[str, Any]:
    """The fields `latent_spread` and `quietest` of FitResult on the novice's motion."""
    bound = math.exp(MIN_LOG_STD) * (1 + 1e-5)
    encoder, decoder = model.encoders["novice"], model.decoders["novice"]
    latents, transitions, quiet = [], [], []
    with torch.inference_mode():
        for part in motion.split(EVALUATION_BATCH):
            latent = encoder.distribution(part.inputs, part.maps)  # type: ignore[operator]
            transition, _ = model.sidm.distribution(latent.mean)  # type: ignore[operator]
            output = decoder.distribution(transition.mean)  # type: ignore[operator]
            latents.append(latent)
            transitions.append(transition)
            all_stds = latent.std, transition.std, output.std / decoder.target_std
            quiet.append([float((std <= bound).double().mean()) for std in all_stds])
    spreads = []
    for parts in (latents, transitions):
        means, stds = (
            torch.cat(values).flatten(0, 1) for values in zip(*parts, strict=True)
        )
        spreads.append(float(stds.mean() / means.std(0).mean()))
    shares = tuple(np.mean(quiet, axis=0).tolist())
    return {"latent_spread": tuple(spreads), "quietest": shares}


def rollout_coverage(
    model: StochasticPredictor, trial: Trial, library: Library, particles: int
) -> PathCoverage:
    """How the particles' intervals fit the actual paths, mean over the rollouts."""
    noise = generator(trial.seed, "particles")
    coverages = []
    grounds = library.rollout_heights(trial)
    for drive, heights in zip(library.rollouts(trial), grounds, strict=True):
        actual, actions = (
            torch.from_numpy(np.asarray(values, float))
            for values in (
                drive.states[: ROLLOUT_STEPS + 1],
                drive.actions[:ROLLOUT_STEPS],
            )
        )
        pixels = trial.network.pixels
        paths = particle_rollout(
            model, heights, actual[0], actions, pixels, particles, noise
        )
        coverages.append(path_coverage(paths, actual, LEVELS))
    return PathCoverage(
        *(torch.stack(parts).double().mean(0) for parts in zip(*coverages, strict=True))
    )
