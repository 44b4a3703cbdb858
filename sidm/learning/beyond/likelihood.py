"""Algorithms 1 and 2 with the negative log-likelihood as the loss of the prediction (section 3.2, last paragraph)."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import torch
from torch import Tensor

from sidm.config import ConfigError
from sidm.learning.beyond.distributions import DistributionModel
from sidm.learning.dataset import Datasets, Motion, Part, Standardisation
from sidm.learning.evaluation import EVALUATION_BATCH
from sidm.learning.learner import Learner
from sidm.learning.regularisation import regularise_phase
from sidm.learning.seeds import generator
from sidm.learning.settings import Network, Training
from sidm.learning.stopping import Tested
from sidm.learning.training import Trained, result
from sidm.learning.weights import Follower, make_optimiser
from sidm.systems import ROLES

#: Settings that have one value here.
ONLY = {
    "precision": "float32", "frozen": "nothing", "reduction": "sum", "stopping": "test_loss", "matching": "adversary",
    "own": "all",
}  # fmt: skip


class DistributionLearner(Learner):
    """A model of distributions in training; losses and tests are negative log-likelihoods, nats a sample.

    Raises:
        ConfigError: a setting that a likelihood does not know.
    """

    def __init__(
        self,
        datasets: Datasets,
        network: Network,
        training: Training,
        seed: int,
        standardisation: Standardisation,
        start: Mapping[str, Tensor] | None = None,
    ):
        for name, only in ONLY.items():
            value = getattr(training, name, getattr(network, name, None))
            if value != only:
                raise ConfigError(f"training by likelihood has no {name}={value!r}, only {only!r}")
        super().__init__(datasets, network, training, seed, standardisation)
        roles = ROLES if training.needs_expert else ("novice",)
        self.model: DistributionModel = DistributionModel(network, standardisation, seed, roles)  # type: ignore
        if start is not None:
            self.model.load_state_dict(dict(start))
        self.prediction, self.follower = make_optimiser(self.model, training), Follower(self.model, training)
        own = training.matching_optimiser == "own"
        self.matching = make_optimiser(self.model.encoders["novice"], training) if own else self.prediction
        self.noise = generator(seed, "latents")
        self.best = self.weights()

    def encode(self, role: str, motion: Motion) -> Tensor:
        """A draw of latent state-actions (b, T, 128)."""
        return self.model.encode(role, motion.inputs, motion.maps, self.noise)

    def take_test(self) -> Tested:
        """Measure the likelihood of the test split; keep the weights if its smoothed value is the best so far."""
        with self.follower.averaged():
            if self.judge(mean_nll(self.model, self.test)):
                self.best = self.weights()
        return self.history[-1]


def mean_nll(model: DistributionModel, motion: Motion | Part, role: str = "novice") -> float:
    """Negative log-likelihood, nats, averaged over the steps of `motion`, all latents at their means."""
    total = 0.0
    with torch.inference_mode():
        for part in motion.split(EVALUATION_BATCH):
            found, _ = model.predict(role, part.inputs, part.maps)
            total += float(found.nll(part.targets).double().sum())
    return total / motion.targets[..., 0].numel()


def train_distributions(
    datasets: Datasets,
    network: Network,
    training: Training,
    seed: int,
    standardisation: Standardisation,
    start: Mapping[str, Tensor] | None = None,
    progress: Callable[[Tested], None] | None = None,
) -> Trained:
    """`training.train` for distributions: the same phases and the same rule to stop by, without checkpoints.

    The test likelihood that it stops by is that of the latents' means: the mixture over draws of them, which
    `particles.one_step` reports, costs as many times as much.

    Raises:
        ConfigError: data that the settings need are not there, or settings that it does not know.
        TrainingError: a test found a loss that is not finite; the message names the iteration.
    """
    learner = DistributionLearner(datasets, network, training, seed, standardisation, start)
    while not learner.finished:
        predict_phase(learner, progress)
        if training.regularise and not learner.finished:
            regularise_phase(learner)
    if not learner.history:
        learner.take_test()
    return result(learner)


def predict_phase(learner: DistributionLearner, progress: Callable[[Tested], None] | None = None) -> None:
    """Algorithm 1 with equation (1) replaced by the negative log-likelihood."""
    for _ in range(learner.training.prediction_iterations):
        batch = learner.draw_batch()
        losses = batch_nll(learner, batch)
        learner.prediction.zero_grad()
        torch.cat(list(losses.values())).mean().backward()
        learner.update()
        learner.note(losses)
        if learner.iteration % learner.training.test_interval == 0:
            tested = learner.take_test()
            if progress is not None:
                progress(tested)
        if learner.finished:
            return


def batch_nll(learner: DistributionLearner, batch: dict[str, Motion]) -> dict[str, Tensor]:
    """Negative log-likelihood of each sample of a batch by system, (b, T) each; the SIDM sees all at once."""
    model = learner.model
    latents = [learner.encode(role, motion) for role, motion in batch.items()]
    transitions, _ = model.transit(torch.cat(latents), generator=learner.noise)
    parts = transitions.split([len(motion) for motion in batch.values()])
    return {
        role: model.decoders[role].distribution(part).nll(motion.targets)  # type: ignore[operator]
        for (role, motion), part in zip(batch.items(), parts, strict=True)
    }
