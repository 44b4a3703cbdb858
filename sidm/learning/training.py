"""Algorithms 1 and 2 of the paper: prediction and regularisation in turn, until the novice's test loss rises.

The comparison without SIDM is the same loop with p_expert = 0 and regularise = False.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import torch
from torch import Tensor

from sidm.learning.dataset import Datasets, Motion, Standardisation
from sidm.learning.learner import Learner, Tested, TrainingError
from sidm.learning.losses import expected_discriminator_loss, expected_matching_loss, prediction_loss
from sidm.learning.networks import DynamicsModel, Network
from sidm.learning.observation import TARGET_SIZE
from sidm.learning.precision import products
from sidm.learning.settings import Training

__all__ = ["Tested", "Trained", "Training", "TrainingError", "result", "train"]


class Trained(NamedTuple):
    """What a run gives."""

    model: DynamicsModel  # with the weights of the lowest smoothed test loss
    history: list[Tested]  # the learning curve, one entry a test
    samples: int  # control steps of the prediction phases
    iterations: int  # of the prediction phases
    best_test_loss: float  # smoothed, of the weights returned
    best_samples: int  # seen when they were reached
    stopped_early: bool  # by the stopping rule, not by max_samples


def train(
    datasets: Datasets,
    network: Network,
    training: Training,
    seed: int,
    *,
    standardisation: Standardisation | None = None,
    checkpoint: Path | None = None,
    progress: Callable[[Tested], None] | None = None,
    device: str | torch.device = "cpu",
    start: Mapping[str, Tensor] | None = None,
) -> Trained:
    """Train a model from fresh weights or from `start`: Algorithms 1 and 2 in turn (section 3.2).

    Args:
        datasets: the novice's train and test split, and the expert's data unless p_expert is 0 without regularisation.
        network: sizes of the networks; `pixels` are those of the datasets' maps.
        training: every choice of the algorithms.
        seed: of the initial weights and all draws; what two methods share begins and is drawn alike.
        standardisation: units inside the networks; computed from the expert's data by default.
        checkpoint: a folder to go on from, bit for bit on one thread, and to write the state to after each phase.
        progress: called after each test.
        device: where to compute.
        start: initial weights, such as `pretraining.start_from` gives; fresh ones by default.

    Returns:
        The best model by test loss, and how it came about. A function of the arguments up to `standardisation`, and of
        `start`.

    Raises:
        ConfigError: data that the settings need are not there.
        CheckpointError: the checkpoint is damaged or of another run.
        TrainingError: a test found a loss that is not finite; the message names the iteration.
    """
    learner = Learner(datasets, network, training, seed, standardisation, device, start)
    if checkpoint is not None:
        learner.restore(checkpoint)
    with products(training.precision):
        while not learner.finished:
            predict_phase(learner, progress)
            if training.regularise and not learner.finished:
                regularise_phase(learner)
            if checkpoint is not None:
                learner.save(checkpoint)
        if not learner.history:
            _test(learner, progress)
    return result(learner)


def predict_phase(learner: Learner, progress: Callable[[Tested], None] | None = None) -> None:
    """Algorithm 1: the parts of the systems drawn, and the SIDM, learn to predict."""
    training = learner.training
    for _ in range(training.prediction_iterations):
        losses = batch_losses(learner, learner.draw_batch())
        loss = torch.cat(list(losses.values())).mean()  # over the whole batch, whatever the system
        learner.prediction.zero_grad()
        (loss / TARGET_SIZE if training.reduction == "mean" else loss).backward()
        learner.prediction.step()
        learner.note(losses)
        if learner.iteration % training.test_interval == 0:
            _test(learner, progress)
        if learner.finished:
            return


def regularise_phase(learner: Learner) -> None:
    """Algorithm 2: the discriminator learns to tell the systems' latents apart, then E_n learns to deceive it."""
    for _ in range(learner.training.discriminator_iterations):
        discriminator_iteration(learner)
    for _ in range(learner.training.matching_iterations):
        matching_iteration(learner)


def discriminator_iteration(learner: Learner) -> None:
    """One update of A alone, equation (2)."""
    count = learner.training.discriminator_batch
    expert = learner.draw("expert", count, "discriminator expert")
    novice = learner.draw("novice", count, "discriminator novice")
    with torch.no_grad():
        expert_latents, novice_latents = encode(learner, "expert", expert), encode(learner, "novice", novice)
    expert_logits, novice_logits = map(learner.discriminator.logits, (expert_latents, novice_latents))
    learner.discrimination.zero_grad()
    expected_discriminator_loss(expert_logits, novice_logits).backward()
    learner.discrimination.step()
    right = torch.cat([expert_logits > 0, novice_logits < 0])
    learner.accuracy = float(right.float().mean())


def matching_iteration(learner: Learner) -> None:
    """One update of E_n alone, equation (4)."""
    encoder = learner.model.encoders["novice"]
    novice = learner.draw("novice", learner.training.matching_batch, "matching")
    loss = expected_matching_loss(learner.discriminator.logits(encode(learner, "novice", novice)))
    learner.prediction.zero_grad()  # drops the gradients of all parts; those without one are not stepped
    loss.backward(inputs=list(encoder.parameters()))
    learner.matching.step()


def encode(learner: Learner, role: str, motion: Motion) -> Tensor:
    """Latent state-actions (b, T, 128), float32, computed in the training's precision."""
    low = learner.training.precision == "bfloat16"
    with torch.autocast(learner.device.type, torch.bfloat16, enabled=low):
        return learner.model.encoders[role](motion.inputs, motion.maps)


def batch_losses(learner: Learner, batch: dict[str, Motion]) -> dict[str, Tensor]:
    """Equation (1) for each sample of a batch by system, (b, T) each; the SIDM sees the whole batch at once."""
    model = learner.model
    transitions, _ = model.sidm(torch.cat([encode(learner, role, motion) for role, motion in batch.items()]))
    parts = transitions.split([len(motion) for motion in batch.values()])
    return {
        role: prediction_loss(model.decoders[role](part), motion.targets)
        for (role, motion), part in zip(batch.items(), parts, strict=True)
    }


def _test(learner: Learner, progress: Callable[[Tested], None] | None) -> None:
    tested = learner.take_test()
    if progress is not None:
        progress(tested)


def result(learner: Learner) -> Trained:
    """The best model of a finished run, and how it came about."""
    best = learner.stopper.best
    assert best is not None  # there was a test
    learner.model.load_state_dict(learner.best)
    return Trained(
        model=learner.model.eval(),
        history=learner.history,
        samples=learner.samples,
        iterations=learner.iteration,
        best_test_loss=best,
        best_samples=learner.stopper.best_samples,
        stopped_early=learner.samples < learner.training.max_samples,
    )
