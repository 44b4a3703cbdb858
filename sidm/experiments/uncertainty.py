"""How sure the models are: training by likelihood beside its deterministic twin (section 3.2, last paragraph).

`python -m sidm study uncertainty` makes what is not stored of it in results/uncertainty.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from sidm.config import config
from sidm.experiments.measure import ROLLOUT_STEPS, Library, one_thread
from sidm.experiments.methods import COMPARED
from sidm.experiments.models import model_of
from sidm.experiments.provenance import Provenance, source_hash
from sidm.experiments.records import Making, Records
from sidm.experiments.study import Study
from sidm.experiments.trials import Trial
from sidm.learning.dataset import Datasets, Motion, Part, Standardisation
from sidm.learning.distributions import ConstantSpread, DistributionModel, Stochastic
from sidm.learning.evaluation import EVALUATION_BATCH, validation_loss
from sidm.learning.likelihood import train_distributions
from sidm.learning.model import DynamicsModel, Predictor
from sidm.learning.particles import LEVELS, covered, one_step, particle_rollout
from sidm.learning.seeds import generator
from sidm.systems import find_system
from sidm.terrain import generate_terrain

SIZES = (1.0, 5.0, 60.0)  # novice data, min
PARTICLES = 64  # of a rollout


@config
class Fit:
    """A model whose certainty is looked at."""

    trial: Trial  # of the deterministic twin; the likelihood's model has all but its loss
    likelihood: bool  # whether it is trained by likelihood; otherwise it is the twin, with a constant spread
    particles: int


@config
class Fitted:
    """What came out; L levels of intervals, K steps."""

    about: Fit
    validation_loss: float  # equation (1) of the means
    nll: float  # on the validation set, nats a sample
    coverage: tuple[tuple[float, ...], ...]  # (L, 13) of one step
    steps_coverage: tuple[tuple[tuple[float, ...], ...], ...]  # (L, K, 3) along rollouts: forward, sideways, heading
    samples: int  # seen by prediction training; 0 for a twin, whose trial says it
    source: str  # hash of the code
    provenance: Provenance

    @property
    def stale(self) -> bool:
        """Whether the code has changed since."""
        return self.source != source_hash("uncertainty")


def fits(study: Study, system: str, sizes: Iterable[float] = SIZES, particles: int = PARTICLES) -> list[Fit]:
    """With and without SIDM, each by likelihood and as the twin, at every size and seed."""
    trials = study.points(system, COMPARED, sizes)
    return [Fit(trial=trial, likelihood=by, particles=particles) for trial in trials for by in (True, False)]


def fit(about: Fit, data: str | Path = "data") -> Fitted:
    """Train and judge one; ShardError where data are missing."""
    making, trial = Making("uncertainty", about.trial, data), about.trial
    with one_thread():
        library = Library(data)
        sets, samples = library.datasets(trial), 0
        predictor: Predictor
        model: Stochastic
        if about.likelihood:
            assert sets.expert is not None
            units = Standardisation.of(sets.expert)
            trained = train_distributions(sets, trial.network, trial.training, trial.seed, units)
            assert isinstance(trained.model, DistributionModel)
            predictor = model = trained.model
            samples = trained.samples
        else:
            predictor = twin = model_of(trial, data)
            model = ConstantSpread(twin, residual_spread(twin, sets))
        found = one_step(model, sets.validation, generator(trial.seed, "validation"))
        along = rollout_coverage(model, trial, library, about.particles)
        loss = float(validation_loss(predictor, sets.validation).sum())
    return Fitted(
        about=about,
        validation_loss=loss,
        nll=found.nll,
        coverage=found.coverage,
        steps_coverage=tuple(tuple(tuple(step) for step in level) for level in along.tolist()),
        samples=samples,
        **making.done(),
    )


def residual_spread(model: DynamicsModel, sets: Datasets) -> Tensor:
    """(13,) root mean squared errors on the test split, which no weights have learnt from; never wholly 0."""
    return component_errors(model, sets.test).sqrt().clamp_min(1e-6)


def component_errors(model: DynamicsModel, motion: Motion | Part) -> Tensor:
    """(13,) mean squared errors over the steps of some motion."""
    total = torch.zeros(13, dtype=torch.float64)
    with torch.inference_mode():
        for part in motion.split(EVALUATION_BATCH):
            total += (model("novice", part.inputs, part.maps)[0] - part.targets).square().double().sum((0, 1))
    return (total / motion.targets[..., 0].numel()).float()


def rollout_coverage(model: Stochastic, trial: Trial, library: Library, particles: int) -> Tensor:
    """(L, K, 3): how often what happened lies within the particles' intervals, over the rollouts of the trial."""
    terrain, noise = find_system(trial.system).terrain, generator(trial.seed, "particles")
    found = []
    for trajectory in library.rollouts(trial):
        heights = torch.from_numpy(generate_terrain(terrain, trajectory.terrain_seed))
        states = torch.from_numpy(np.asarray(trajectory.states[: ROLLOUT_STEPS + 1], float))
        actions = torch.from_numpy(np.asarray(trajectory.actions[:ROLLOUT_STEPS], float))
        paths = particle_rollout(model, heights, states[0], actions, trial.network.pixels, particles, noise)
        found.append(covered(paths, states, LEVELS))
    return torch.stack(found).double().mean(0)


def stored(results: str | Path = "results") -> Records[Fitted]:
    """Where the results are kept."""
    return Records(Fitted, Path(results) / "uncertainty", "python -m sidm study uncertainty")
