"""Algorithms 1 and 2 of the paper: prediction and regularisation in turn, until the novice's test loss rises.

The comparison without SIDM is the same loop with p_expert = 0 and regularise = False.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import torch
from torch import Tensor

from sidm.learning.arithmetic import flushed_denormals, matmul_precision
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.learner import Learner
from sidm.learning.losses import prediction_loss
from sidm.learning.model import Predictor
from sidm.learning.observation import TARGET_SIZE
from sidm.learning.regularisation import regularise_phase, reversed_loss
from sidm.learning.stopping import Components, Tested, TrainingError
from sidm.learning.units import Units
from sidm.settings import Network, Training

__all__ = ["Tested", "Trained", "Training", "TrainingError", "result", "train"]

SAVING = 0.02  # share of the time that may go into writing checkpoints; the first and the last phase always write one
LONGEST = 60.0  # s without a checkpoint, however long one takes

Progress = Callable[[Tested], None]  # called after each test
Losses = Callable[..., dict[str, Tensor]]  # as `batch_losses`


class Trained(NamedTuple):
    """What a run gives."""

    model: Predictor  # with the weights of the lowest smoothed test loss
    history: list[Tested]  # the learning curve, one entry a test
    samples: int  # control steps of the prediction phases
    iterations: int  # of the prediction phases
    best_test_loss: float  # smoothed, of the weights returned
    best_samples: int  # seen when they were reached
    stopped_early: bool  # by the stopping rule, not by max_samples
    components: Sequence[Components] = ()  # the loss by component at some tests; none of a closed form


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
        datasets: the novice's train and test split, and the expert's data unless p_expert is 0 without regularisation.
        network: sizes of the networks; `pixels` are those of the datasets' maps.
        training: every choice of the algorithms.
        seed: of the initial weights and all draws; what two methods share begins and is drawn alike.
        standardisation: units inside the networks, of all systems or of each; by default those of `units_of`.
        checkpoint: a folder to go on from, bit for bit on one thread, and to write the state to after phases.
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

    Examples:
        >>> from sidm.learning import Datasets, windows_of
        >>> windows = windows_of(sidm.simulate("system1", "novice", minutes=0.3), pixels=8)
        >>> sets = Datasets(train=windows.subset([0]), test=windows.subset([1]), validation=windows, expert=windows)
        >>> network = sidm.Network(pixels=8, layers=1, hidden=8)
        >>> trained = sidm.train(sets, network, sidm.Training(batch=2, max_samples=3_000), seed=0)
        >>> trained.samples
        3072
    """
    learner = Learner(datasets, network, training, seed, standardisation, device, start)
    if checkpoint is not None:
        learner.restore(checkpoint)
    with matmul_precision(training.precision), flushed_denormals():
        return learn(learner, progress, checkpoint)


def learn(
    learner: Learner, progress: Progress | None = None, checkpoint: Path | None = None, losses_of: Losses | None = None
) -> Trained:
    """Algorithms 1 and 2 in turn until a learner is finished; `losses_of` as of `predict_phase`."""
    saved, cost = -math.inf, 0.0
    while not learner.finished:
        predict_phase(learner, progress, losses_of)
        if learner.training.regularise and not learner.training.reverses and not learner.finished:
            regularise_phase(learner)
        due = time.monotonic() - saved > min(cost / SAVING, LONGEST)
        if checkpoint is not None and (learner.finished or due):
            start = time.monotonic()
            learner.save(checkpoint)
            saved = time.monotonic()
            cost = saved - start
    if not learner.history:
        _test(learner, progress)
    return result(learner)


def predict_phase(learner: Learner, progress: Progress | None = None, losses_of: Losses | None = None) -> None:
    """Algorithm 1: the parts of the systems drawn, and the SIDM, learn to predict.

    Args:
        learner: in training.
        progress: called after each test.
        losses_of: another loss than equation (1), as `batch_losses` takes its arguments.
    """
    training = learner.training
    for _ in range(training.prediction_iterations):
        batch = learner.draw_batch()
        latents = encode_batch(learner, batch)
        losses = (losses_of or batch_losses)(learner, batch, latents)
        loss = torch.cat(list(losses.values())).mean()  # over the whole batch, whatever the system
        aim = loss / TARGET_SIZE if training.reduction == "mean" else loss
        learner.clear_gradients()
        if training.reverses:
            learner.discrimination.zero_grad()
            aim = aim + reversed_loss(learner, latents)
        aim.backward()
        learner.update()
        learner.note(losses)
        if learner.iteration % training.test_interval == 0:
            _test(learner, progress)
        if learner.finished:
            return


def encode_batch(learner: Learner, batch: dict[str, Windows]) -> dict[str, Tensor]:
    """Latent state-actions (b, T, 128) of a batch by system."""
    return {role: learner.encode(role, motion) for role, motion in batch.items()}


def batch_losses(learner: Learner, batch: dict[str, Windows], latents: dict[str, Tensor]) -> dict[str, Tensor]:
    """Equation (1) for each sample of a batch and its latents by system, (b, T) each; the SIDM sees all at once."""
    model = learner.model
    transitions, _ = model.sidm(torch.cat(list(latents.values())))
    parts = transitions.split([len(motion) for motion in batch.values()])
    return {
        role: prediction_loss(model.decoders[role](part), motion.targets, model.loss_weights(role))
        for (role, motion), part in zip(batch.items(), parts, strict=True)
    }


def _test(learner: Learner, progress: Progress | None) -> None:
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
        components=learner.components,
    )
