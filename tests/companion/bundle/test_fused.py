"""The kernels of a bundle on a GPU, computed by Triton's interpreter on a CPU."""

import dataclasses

import pytest
import torch
import torch.nn.functional as F

from companion.bundle import fused
from companion.bundle.bundle import Bundle
from companion.bundle.bundled_trial import BundledTrial
from companion.bundle.models import recurrence
from companion.bundle.training import device_data

DEVICE = "cuda" if torch.cuda.is_available() else "cpu"
pytestmark = pytest.mark.triton


def close(computed, expected):
    """Whether two tensors differ by rounding of sums in another order alone."""
    size = expected.abs().max().item()
    return torch.allclose(computed, expected, rtol=1e-4, atol=1e-6 * size)


def random(*shape, scale=1.0):
    generator = torch.Generator().manual_seed(sum(shape))
    return (torch.randn(*shape, generator=generator) * scale).to(DEVICE)


@pytest.mark.parametrize("batch", fused.BATCHES)
def test_the_steps_of_an_lstm(batch):
    inputs = random(2, 3, batch, 256).requires_grad_()
    recurrent = random(2, 256, 64, scale=0.1).requires_grad_()
    results = []
    for layer in (recurrence, fused.FusedRecurrence.apply):
        hidden = layer(inputs, recurrent)
        upwards = random(*hidden.shape)
        results.append(
            [hidden, *torch.autograd.grad(hidden, (inputs, recurrent), upwards)]
        )
    for expected, computed in zip(*results, strict=True):
        assert close(computed, expected)


@pytest.mark.parametrize(("steps", "pixels"), [(1, 7), (3, 12)])
def test_the_convolutions(steps, pixels):
    """Pixels of a program end within a trajectory, or the trajectory within them."""
    maps, slope = random(3, steps, 1, pixels, pixels), 0.01
    shapes = (3, 8, 1, 4, 4), (3, 8), (3, 4, 8, 4, 4), (3, 4)
    weights = [random(*shape).requires_grad_() for shape in shapes]
    layers = []
    for one, *own in zip(maps, *weights, strict=True):
        hidden = F.leaky_relu(F.conv2d(one, *own[:2]), slope)
        layers.append(F.leaky_relu(F.conv2d(hidden, *own[2:]), slope))
    expected = torch.stack(layers).movedim(2, -1).flatten(2)
    computed = fused.FusedConvolutions.apply(maps, slope, *weights)
    assert close(computed, expected)
    upwards = random(*expected.shape)
    for gradient, reference in zip(
        torch.autograd.grad(computed, weights, upwards),
        torch.autograd.grad(expected, weights, upwards),
        strict=True,
    ):
        assert close(gradient, reference)


@pytest.mark.more
def test_predictions_and_gradients_of_a_bundle(make_run, small_network, monkeypatch):
    """Networks of both systems, of two trials in one batch."""
    network = dataclasses.replace(small_network, hidden=64)
    runs, device = [make_run(seed) for seed in range(2)], torch.device(DEVICE)
    data = device_data(runs, device)
    trials = [BundledTrial(*one, network, data) for one in enumerate(runs)]
    bundle = Bundle(trials, data, device)
    windows = data.windows.take(torch.arange(8, device=device).reshape(2, 4))
    of_expert = torch.tensor([[True, False, False, True]] * 2, device=device)
    models, results = bundle.stacked.models, []
    parameters = list(models.parameters("model").values())
    for by_kernels in (False, True):
        monkeypatch.setattr(fused, "fits_kernels", lambda tensor, on=by_kernels: on)
        predicted = models.predict(of_expert, windows.inputs, windows.maps)
        gradients = torch.autograd.grad(predicted.square().sum(), parameters)
        results.append([predicted, *gradients])
    for expected, computed in zip(*results, strict=True):
        assert close(computed, expected)
