"""Training on a GPU agrees with training on a CPU but for rounding."""

import pytest
import torch

from companion.bundle import Run, train_bundle
from sidm.learning.training import train
from sidm.settings import Training

pytestmark = pytest.mark.gpu
#: Relative error after five iterations of Adam. Adam divides by the size of a gradient,
#: so rounding errors become whole steps where a gradient is nearly zero.
TOLERANCE = dict(rel=0.01)
SHORT = Training(batch=2, prediction_iterations=5, max_samples=640, test_interval=5)


def losses(trained) -> list[float]:
    return [test.test_loss for test in trained.history]


def test_a_training_agrees(datasets, small_network):
    cpu, gpu = (
        train(datasets, small_network, SHORT, 0, device=device)
        for device in ("cpu", "cuda")
    )
    assert losses(gpu) == pytest.approx(losses(cpu), **TOLERANCE)


def test_a_bundle_agrees(datasets, small_network):
    runs = [Run(datasets, SHORT, seed) for seed in range(3)]
    cuda = torch.device("cuda")
    for ended in train_bundle(runs, small_network, 3, cuda):
        alone = train(datasets, small_network, SHORT, ended.number)
        assert losses(ended.result) == pytest.approx(losses(alone), **TOLERANCE)
