"""How sure the models are: training by likelihood beside its deterministic twin (section 3.2, last paragraph).

`companion run --figure uncertainty` makes what is not stored of it in
results/uncertainty.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from companion.beyond.distributions import (
    QUIETEST,
    ConstantSpread,
    DistributionModel,
    Stochastic,
)
from companion.beyond.likelihood import train_distributions
from companion.beyond.particles import (
    DRAWS,
    LEVELS,
    Along,
    covered,
    one_step,
    particle_rollout,
)
from companion.engine.execute import ROLLOUT_STEPS, Library, curve, judge, plain
from companion.engine.models import model_of
from companion.engine.provenance import Provenance
from companion.engine.records import Making, records_of
from companion.methods import COMPARED
from companion.study import Study
from companion.trials import Trial
from sidm.config import config
from sidm.learning.arithmetic import one_thread
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.evaluation import EVALUATION_BATCH, validation_loss
from sidm.learning.model import DynamicsModel, Predictor
from sidm.learning.seeds import generator
from sidm.learning.training import Trained
from sidm.learning.units import Standardisation
from sidm.shards import simulated_ground

SIZES = (1.0, 5.0, 60.0)  # novice data, min
PARTICLES = 64  # of a rollout
#: The fields on the training of a twin, of which its trial tells.
UNTRAINED: dict[str, Any] = dict.fromkeys(
    ("samples", "best_samples", "best_test_loss", "training_seconds"), 0
) | (dict.fromkeys(("curve_samples", "curve_test_loss", "curve_training_loss"), ()))


@config
class Fit:
    """A model whose certainty is looked at."""

    #: of the deterministic twin; the likelihood's model has all but its loss
    trial: Trial
    #: whether it is trained by likelihood; otherwise it is the twin, with a constant
    #: spread
    likelihood: bool
    particles: int


@config
class Fitted:
    """What came out; L levels of intervals, K steps, three ways: forward, sideways, m, and heading, rad.

    On the validation set unless said. Of a twin's training its trial tells: here it is
    0 and empty.
    """

    about: Fit
    validation_loss: float  # equation (1) of the means that the latents' means lead to
    component_losses: tuple[float, ...]  # (13,) of it
    nll: float  # nats a sample, of the mixture over draws of the latents
    nll_at_means: float  # with the latents at their means
    #: QUANTILES of `companion.beyond.particles`, of single steps' mixtures
    nll_quantiles: tuple[float, ...]
    component_nll: tuple[float, ...]  # (13,) of each component alone
    #: (13,) mean standard deviation given the latents, raw units
    spread: tuple[float, ...]
    #: of encoder and SIDM: mean standard deviation by that of the means; 0 of a twin
    latent_spread: tuple[float, ...]
    #: of encoder, SIDM and decoder: share of deviations at their lower bound; 0 of a
    #: twin
    quietest: tuple[float, ...]
    coverage: tuple[tuple[float, ...], ...]  # (L, 13) of one step
    #: (L, K, 3) along rollouts
    steps_coverage: tuple[tuple[tuple[float, ...], ...], ...]
    #: (L, K, 3) of the intervals, mean over the rollouts
    steps_width: tuple[tuple[tuple[float, ...], ...], ...]
    #: (K, 3) of the particles' mean, mean over the rollouts
    steps_error: tuple[tuple[float, ...], ...]
    position_error: tuple[float, ...]  # (K,) m, of rollouts of the means
    heading_error: tuple[float, ...]  # (K,) rad
    samples: int  # seen by prediction training
    best_samples: int  # until the weights that were kept
    best_test_loss: float  # smoothed: a negative log-likelihood
    curve_samples: tuple[int, ...]  # of at most 40 of the tests
    curve_test_loss: tuple[float, ...]
    curve_training_loss: tuple[float, ...]
    training_seconds: float
    provenance: Provenance


#: where they are kept, under a folder of results
records = records_of(Fitted, "uncertainty")


def jobs(
    study: Study,
    system: str,
    sizes: Iterable[float] = SIZES,
    particles: int = PARTICLES,
) -> list[Fit]:
    """With and without SIDM, each by likelihood and as the twin, at every size and seed."""
    trials = study.points(system, COMPARED, study.preset.held(system, sizes))
    return [
        Fit(trial=trial, likelihood=by, particles=particles)
        for trial in trials
        for by in (True, False)
    ]


def measure(about: Fit, data: str | Path = "data") -> Fitted:
    """Train and judge one; ShardError where data are missing."""
    making, trial = Making("uncertainty", about.trial, data), about.trial
    with one_thread():
        library = Library(data)
        sets = library.datasets(trial)
        if about.likelihood:
            begun = time.perf_counter()
            assert sets.expert is not None
            units = Standardisation.of(sets.expert)
            trained = train_distributions(
                sets, trial.network, trial.training, trial.seed, units
            )
            training = _training(trained, time.perf_counter() - begun)
            assert isinstance(trained.model, DistributionModel)
            predictor: Predictor = trained.model
            found = _judged(trained.model, about, library, DRAWS)
            latents = latents_of(trained.model, sets.validation)
        else:
            predictor = twin = model_of(trial, data)
            found = _judged(
                ConstantSpread(twin, residual_spread(twin, sets)), about, library, 1
            )
            latents, training = (
                {"latent_spread": (0.0, 0.0), "quietest": (0.0, 0.0, 0.0)},
                UNTRAINED,
            )
        means = judge(predictor, trial, library)
    return Fitted(
        about=about,
        validation_loss=float(means.losses.sum()),
        component_losses=plain(means.losses),
        position_error=plain(means.position),
        heading_error=plain(means.heading),
        **found,
        **latents,
        **training,
        provenance=making.done(),
    )


def _training(trained: Trained, seconds: float) -> dict[str, Any]:
    """The fields on the training."""
    own = {
        "samples": trained.samples,
        "best_samples": trained.best_samples,
        "training_seconds": seconds,
    }
    return own | {"best_test_loss": float(trained.best_test_loss)} | curve(trained)


def _judged(
    model: Stochastic, about: Fit, library: Library, draws: int
) -> dict[str, Any]:
    """The fields on likelihood and coverage."""
    trial, validation = about.trial, library.motion(about.trial, "validation")
    found = one_step(model, validation, generator(trial.seed, "validation"), draws)
    along = rollout_coverage(model, trial, library, about.particles)
    return {
        **found._asdict(),
        "nll_at_means": one_step(model, validation, None, 1).nll,
        "steps_coverage": plain(along.inside),
        "steps_width": plain(along.width),
        "steps_error": plain(along.error),
    }


def latents_of(model: DistributionModel, motion: Windows) -> dict[str, Any]:
    """How the spreads of encoder and SIDM compare with what their means vary by, and how many are at the bound."""
    lowest = math.exp(QUIETEST) * (1 + 1e-5)
    encoded, moved, quiet = [], [], []
    with torch.inference_mode():
        for part in motion.split(EVALUATION_BATCH):
            one = model.encoders["novice"].distribution(part.inputs, part.maps)  # type: ignore[operator]
            two, _ = model.sidm.distribution(one.mean)  # type: ignore[operator]
            decoder = model.decoders["novice"]
            three = decoder.distribution(two.mean).std / decoder.target_std  # type: ignore[operator]
            encoded.append(one)
            moved.append(two)
            quiet.append(
                [
                    float((std <= lowest).double().mean())
                    for std in (one.std, two.std, three)
                ]
            )
    spreads = []
    for some in (encoded, moved):
        means, stds = (
            torch.cat([getattr(one, name).flatten(0, 1) for one in some])
            for name in ("mean", "std")
        )
        spreads.append(float(stds.mean() / means.std(0).mean()))
    return {
        "latent_spread": tuple(spreads),
        "quietest": tuple(np.mean(quiet, axis=0).tolist()),
    }


def residual_spread(model: DynamicsModel, sets: Datasets) -> Tensor:
    """(13,) root mean squared errors on the test split, which no weights have learnt from; never wholly 0."""
    return validation_loss(model, sets.test).float().sqrt().clamp_min(1e-6)


def rollout_coverage(
    model: Stochastic, trial: Trial, library: Library, particles: int
) -> Along:
    """How the particles' intervals fit what happened, mean over the rollouts of the trial."""
    noise = generator(trial.seed, "particles")
    found = []
    for trajectory in library.rollouts(trial):
        heights = torch.from_numpy(simulated_ground(trajectory).heights)
        states = torch.from_numpy(
            np.asarray(trajectory.states[: ROLLOUT_STEPS + 1], float)
        )
        actions = torch.from_numpy(
            np.asarray(trajectory.actions[:ROLLOUT_STEPS], float)
        )
        paths = particle_rollout(
            model, heights, states[0], actions, trial.network.pixels, particles, noise
        )
        found.append(covered(paths, states, LEVELS))
    return Along(
        *(torch.stack(parts).double().mean(0) for parts in zip(*found, strict=True))
    )
