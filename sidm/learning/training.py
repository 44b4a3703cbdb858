"""Algorithms 1 and 2 of the paper, in turn until the novice's test loss rises.

The comparison without SIDM is the same loop with p_expert = 0 and regularise = False.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import torch
from torch import Tensor

from sidm.config import ConfigError
from sidm.learning.arithmetic import flushed_denormals, matmul_precision
from sidm.learning.checkpoint import Checkpoint
from sidm.learning.dataset import Datasets
from sidm.learning.losses import (
    expected_discriminator_loss,
    expected_matching_loss,
    one_sided_loss,
)
from sidm.learning.model import Predictor
from sidm.learning.observation import TARGET_SIZE
from sidm.learning.stopping import CurvePoint
from sidm.learning.trainer import Progress, Trainer
from sidm.learning.units import Units
from sidm.settings import Network, Training


class Trained(NamedTuple):
    """The result of a training."""

    model: Predictor  # with the weights of the lowest smoothed test loss
    history: list[CurvePoint]  # the learning curve, one point for each test
    samples: int  # control steps of the prediction phases
    iterations: int  # of the prediction phases
    best_test_loss: float  # smoothed, of the model's weights
    best_samples: int  # samples seen when these weights were reached
    stopped_early: bool  # by the stopping rule, not by max_samples


def train(
    datasets: Datasets,
    network: Network,
    training: Training,
    seed: int,
    *,
    standardisation: Units | None = None,
    checkpoint: Path | None = None,
    progress: Progress | None = None,
    device: str | torch.device = "cpu",
    start: Mapping[str, Tensor] | None = None,
) -> Trained:
    """Train a model with Algorithms 1 and 2 in turn (section 3.2).

    Args:
        datasets: the novice's train and test split, and the expert's data unless
            p_expert is 0 without regularisation.
        network: sizes of the networks; `pixels` are those of the datasets' maps.
        training: every choice of the algorithms.
        seed: of the initial weights and all draws; parts and draws that two methods
            have in common are the same for one seed.
        standardisation: units inside the networks, one for all systems or one for each;
            by default those of `default_units`.
        checkpoint: a folder that the state is written to after phases. If it has a
            checkpoint, training continues from it, bit for bit on one thread.
        progress: called after each test.
        device: the device to compute on.
        start: initial weights by name, such as those of
            `ownrobot.methods.fine_tuning.pretrained_from`; drawn at random by default.

    Returns:
        The best model by test loss, with its learning curve. The result depends on
        `start` and the arguments up to `standardisation` alone.

    Raises:
        ConfigError: data that the settings need are not there.
        CheckpointError: the checkpoint is damaged or of another run.
        TrainingError: a test found a loss that is not finite; the message names the
            iteration.

    Examples:
        >>> from sidm.learning import Datasets, windows_of
        >>> drives = sidm.simulate("system1", "novice", minutes=0.3)
        >>> windows = windows_of(drives, pixels=8)
        >>> train, test = windows.subset([0]), windows.subset([1])
        >>> sets = Datasets(train, test, validation=windows, expert=windows)
        >>> network = sidm.Network(pixels=8, layers=1, hidden=8)
        >>> training = sidm.Training(batch=2, max_samples=3_000)
        >>> trained = sidm.train(sets, network, training, seed=0)
        >>> trained.samples
        3072
    """
    _refuse_data(datasets, training)
    seed = operator.index(seed)  # NumPy's integers are seeds, too
    settings = datasets, network, training, seed, standardisation, device, start
    trainer = (training.trainer() or Trainer)(*settings)
    state = Checkpoint(checkpoint)
    state.restore(trainer)
    with matmul_precision(training.precision), flushed_denormals():
        return learn(trainer, progress, state)


def _refuse_data(datasets: Datasets, training: Training) -> None:
    """Refuse data that no training can have."""
    for name, windows in (("train", datasets.train), ("test", datasets.test)):
        if not len(windows):
            raise ConfigError(f"datasets.{name} has no windows")
    if training.needs_expert and datasets.expert is not None:
        both = datasets.train, datasets.expert
        novice, expert = (windows.stored_inputs.shape[1] for windows in both)
        if novice != expert:
            raise ConfigError(
                f"windows of the novice have {novice} steps, the expert's {expert}"
            )


def learn(
    trainer: Trainer, progress: Progress | None = None, state: Checkpoint | None = None
) -> Trained:
    """Run Algorithms 1 and 2 in turn until the training is finished."""
    state = state or Checkpoint(None)
    while not trainer.finished:
        prediction_phase(trainer, progress)
        if trainer.training.regularise and not trainer.finished:
            regularisation_phase(trainer)
        state.save_when_due(trainer)
    if not trainer.history:
        trainer.run_test(progress)
    return result(trainer)


def prediction_phase(trainer: Trainer, progress: Progress | None = None) -> None:
    """Algorithm 1: encoders, SIDM and decoders learn to predict."""
    training = trainer.training
    for _ in range(training.prediction_iterations):
        batch = trainer.sampler.batch()  # each window the expert's with probability p_e
        latents = trainer.model.latents(batch)
        losses = trainer.model.losses(batch, latents)  # equation (1)
        loss = torch.cat(list(losses.values())).mean()  # over the whole batch
        if training.reduction == "mean":  # over components too, as in the released code
            loss = loss / TARGET_SIZE
        trainer.step_prediction(loss, latents)
        trainer.record_losses(losses)
        if trainer.test_is_due:
            trainer.run_test(progress)
        if trainer.finished:
            return


def regularisation_phase(trainer: Trainer) -> None:
    """Algorithm 2: A learns to tell the latents apart, then E_n to deceive A."""
    if trainer.regularise():
        return
    for _ in range(trainer.training.discriminator_iterations):
        discriminator_iteration(trainer)
    iterations = range(trainer.training.matching_iterations)
    losses = [matching_iteration(trainer) for _ in iterations]
    if losses:
        trainer.matching_loss = sum(losses) / len(losses)


def discriminator_iteration(trainer: Trainer) -> None:
    """Take one step of the discriminator A alone, with equation (2)."""
    batch = trainer.sampler.discriminator_batch()
    with torch.no_grad():
        latents = trainer.model.latents(batch)
    logits = trainer.discriminate(latents)
    loss = expected_discriminator_loss if len(logits) == 2 else one_sided_loss
    trainer.step_discriminator(loss(**logits))


def matching_iteration(trainer: Trainer) -> float:
    """Step the novice's encoder E_n alone by equation (4); the loss before the step."""
    latents = trainer.model.encode("novice", trainer.sampler.matching_batch())
    loss = expected_matching_loss(trainer.discriminator.logits(latents))
    trainer.step_encoder(loss)
    return float(loss.detach())


def result(trainer: Trainer) -> Trained:
    """The best model of a finished training, with its learning curve."""
    best = trainer.stopping.best
    assert best is not None  # every training has at least one test
    trainer.model.load_state_dict(trainer.best_weights)
    return Trained(
        model=trainer.model.eval(),
        history=trainer.history,
        samples=trainer.samples,
        iterations=trainer.iteration,
        best_test_loss=best,
        best_samples=trainer.stopping.best_samples,
        stopped_early=trainer.samples < trainer.training.max_samples,
    )
