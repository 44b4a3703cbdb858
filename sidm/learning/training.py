"""Algorithms 1 and 2 of the paper: prediction and regularisation in turn, until the novice's test loss rises.

The comparison without SIDM is the same loop with p_expert = 0 and regularise = False.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import torch
from torch import Tensor

from sidm.learning.arithmetic import flushed_denormals, matmul_precision
from sidm.learning.dataset import Datasets
from sidm.learning.losses import (
    expected_discriminator_loss,
    expected_matching_loss,
    one_sided_loss,
)
from sidm.learning.model import Predictor
from sidm.learning.observation import TARGET_SIZE
from sidm.learning.resuming import Checkpoint
from sidm.learning.stopping import Components, Tested, TrainingError
from sidm.learning.trainer import Progress, Trainer
from sidm.learning.units import Units
from sidm.settings import Network, Training

__all__ = [
    "Progress",
    "Tested",
    "Trained",
    "Training",
    "TrainingError",
    "learn",
    "result",
    "train",
]


class Trained(NamedTuple):
    """The result of a training."""

    model: Predictor  # with the weights of the lowest smoothed test loss
    history: list[Tested]  # the learning curve, one entry a test
    samples: int  # control steps of the prediction phases
    iterations: int  # of the prediction phases
    best_test_loss: float  # smoothed, of the weights returned
    best_samples: int  # seen when they were reached
    stopped_early: bool  # by the stopping rule, not by max_samples
    #: the loss by component at some tests; none of a closed form
    components: Sequence[Components] = ()


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
    """Train a model from fresh weights or from `start`: Algorithms 1 and 2 in turn (section 3.2).

    Args:
        datasets: the novice's train and test split, and the expert's data unless
            p_expert is 0 without regularisation.
        network: sizes of the networks; `pixels` are those of the datasets' maps.
        training: every choice of the algorithms.
        seed: of the initial weights and all draws; what two methods share begins and is
            drawn alike.
        standardisation: units inside the networks, of all systems or of each; by
            default those of `units_of`.
        checkpoint: a folder to go on from, bit for bit on one thread, and to write the
            state to after phases.
        progress: called after each test.
        device: where to compute.
        start: initial weights, such as `rivals.fine_tuning.start_from(...).weights`;
            fresh ones by default.

    Returns:
        The best model by test loss, and how it came about. A function of the arguments
        up to `standardisation`, and of `start`.

    Raises:
        ConfigError: data that the settings need are not there.
        CheckpointError: the checkpoint is damaged or of another run.
        TrainingError: a test found a loss that is not finite; the message names the
            iteration.

    Examples:
        >>> from sidm.learning import Datasets, windows_of
        >>> windows = windows_of(sidm.simulate("system1", "novice", minutes=0.3), pixels=8)
        >>> sets = Datasets(train=windows.subset([0]), test=windows.subset([1]), validation=windows, expert=windows)
        >>> network = sidm.Network(pixels=8, layers=1, hidden=8)
        >>> trained = sidm.train(sets, network, sidm.Training(batch=2, max_samples=3_000), seed=0)
        >>> trained.samples
        3072
    """
    trainer, state = (
        Trainer(datasets, network, training, seed, standardisation, device, start),
        Checkpoint(checkpoint),
    )
    state.restore(trainer)
    with matmul_precision(training.precision), flushed_denormals():
        return learn(trainer, progress, state)


def learn(
    trainer: Trainer, progress: Progress | None = None, state: Checkpoint | None = None
) -> Trained:
    """Algorithms 1 and 2 in turn until a training is finished."""
    state = state or Checkpoint(None)
    while not trainer.finished:
        predict(trainer, progress)
        if trainer.training.regularise and not trainer.finished:
            regularise(trainer)
        state.save_when_due(trainer)
    if not trainer.history:
        trainer.take_test(progress)
    return result(trainer)


def predict(trainer: Trainer, progress: Progress | None = None) -> None:
    """Algorithm 1: the parts of the systems drawn, and the SIDM, learn to predict."""
    training = trainer.training
    for _ in range(training.prediction_iterations):
        batch = trainer.sampler.batch()  # each window the expert's with probability p_e
        latents = {
            role: trainer.encode(role, windows) for role, windows in batch.items()
        }
        losses = trainer.model.losses(batch, latents)  # equation (1)
        # over the whole batch, whatever the system
        loss = torch.cat(list(losses.values())).mean()
        trainer.step_prediction(
            loss / TARGET_SIZE if training.reduction == "mean" else loss, latents
        )
        trainer.note(losses)
        if trainer.test_is_due:
            trainer.take_test(progress)
        if trainer.finished:
            return


def regularise(trainer: Trainer) -> None:
    """Algorithm 2: the discriminator learns to tell the systems' latents apart, then E_n learns to deceive it."""
    if any(hook.regularise(trainer) for hook in trainer.hooks):
        return
    for _ in range(trainer.training.discriminator_iterations):
        discriminator_iteration(trainer)
    for _ in range(trainer.training.matching_iterations):
        matching_iteration(trainer)


def discriminator_iteration(trainer: Trainer) -> None:
    """One step of A alone, equation (2)."""
    batch = trainer.sampler.discriminator_batch()
    with torch.no_grad():
        latents = {
            role: trainer.encode(role, windows) for role, windows in batch.items()
        }
    logits = trainer.discriminate(latents)
    loss = (
        expected_discriminator_loss(**logits)
        if len(logits) > 1
        else one_sided_loss(**logits)
    )
    trainer.step_discriminator(loss)


def matching_iteration(trainer: Trainer) -> None:
    """One step of E_n alone, equation (4)."""
    latents = trainer.encode("novice", trainer.sampler.matching_batch())
    trainer.step_encoder(expected_matching_loss(trainer.discriminator.logits(latents)))


def result(trainer: Trainer) -> Trained:
    """The best model of a finished training, and how it came about."""
    best = trainer.stopping.best
    assert best is not None  # there was a test
    trainer.model.load_state_dict(trainer.best)
    return Trained(
        model=trainer.model.eval(),
        history=trainer.history,
        samples=trainer.samples,
        iterations=trainer.iteration,
        best_test_loss=best,
        best_samples=trainer.stopping.best_samples,
        stopped_early=trainer.samples < trainer.training.max_samples,
        components=trainer.components,
    )
