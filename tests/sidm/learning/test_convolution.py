"""The encoder's convolutions in Numba against PyTorch's."""

import numpy as np
import pytest
import torch
from torch import nn

from sidm.learning import Encoder, Network, convolution
from sidm.learning.convolution import is_fast_for

#: tolerance: sums of up to about 50,000 products run in another order
ROUNDING = {torch.float32: 1e-4, torch.float64: 1e-12}


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def layers_of(
    channels=(8, 4), kernel=4, slope=0.01, dtype=torch.float32, seed=0
) -> nn.Sequential:
    first, second = channels
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        made = nn.Sequential(
            nn.Conv2d(1, first, kernel),
            nn.LeakyReLU(slope),
            nn.Conv2d(first, second, kernel),
            nn.LeakyReLU(slope),
        )
    return made.to(dtype).to(memory_format=torch.channels_last)


def numbers(*shape, dtype=torch.float32, seed=1) -> torch.Tensor:
    return torch.randn(
        *shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64
    ).to(dtype)


def features(
    layers: nn.Sequential, maps: torch.Tensor, *units, count=3
) -> torch.Tensor:
    """Features of maps.

    `count` further numbers stand behind the features; they must stay and are removed.
    """
    beside = numbers(len(maps), count, dtype=maps.dtype, seed=3)
    outputs = convolution.features(layers, maps, beside, *units)
    assert torch.equal(outputs[:, outputs.shape[1] - count :], beside)
    return outputs[:, : outputs.shape[1] - count]


def fast(layers: nn.Sequential, maps: torch.Tensor) -> bool:
    return is_fast_for(layers, maps, numbers(len(maps), 3, dtype=maps.dtype))


def by_pytorch(layers: nn.Sequential, maps: torch.Tensor) -> torch.Tensor:
    return layers(maps[:, None]).movedim(1, -1).flatten(1)


def gradients(
    layers: nn.Sequential, found: torch.Tensor, weights: torch.Tensor
) -> list[torch.Tensor]:
    return list(torch.autograd.grad(found, list(layers.parameters()), weights))


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
@pytest.mark.parametrize(
    ("count", "pixels", "channels"),
    [
        (1, 7, (8, 4)),
        (5, 8, (8, 4)),
        (16, 9, (8, 4)),
        (33, 12, (4, 4)),
        (130, 32, (8, 4)),
        (17, 64, (8, 4)),
        (20, 16, (4, 8)),
        (3, 11, (16, 12)),
    ],
)
def test_features_and_gradients_are_pytorchs(count, pixels, channels, dtype):
    layers = layers_of(channels, dtype=dtype)
    maps = numbers(count, pixels, pixels, dtype=dtype)
    assert fast(layers, maps)
    outputs, expected = features(layers, maps), by_pytorch(layers, maps)
    assert outputs.shape == expected.shape and outputs.dtype == dtype
    assert torch.allclose(
        outputs, expected, rtol=0, atol=ROUNDING[dtype] * expected.abs().max().item()
    )
    weights = numbers(*expected.shape, dtype=dtype, seed=2)
    for mine, theirs in zip(
        gradients(layers, outputs, weights),
        gradients(layers, expected, weights),
        strict=True,
    ):
        assert torch.allclose(
            mine, theirs, rtol=0, atol=ROUNDING[dtype] * theirs.abs().max().item()
        )


@pytest.mark.parametrize("slope", [0.01, 0.0, 0.5])
def test_gradients_are_those_of_finite_differences(slope):
    layers = layers_of((4, 4), slope=slope, dtype=torch.float64)
    maps = numbers(3, 8, 8, dtype=torch.float64)
    parameters = [
        weights.detach().clone().requires_grad_() for weights in layers.parameters()
    ]
    beside, work = numbers(3, 2, dtype=torch.float64), convolution._Convolutions.apply
    assert torch.autograd.gradcheck(
        lambda *own: work(maps, beside, *own, (slope, 0.3, 1.7)), parameters
    )


def test_units_of_the_maps():
    layers, maps = layers_of(), 0.2 * numbers(18, 10, 10) + 1
    mean, std = torch.tensor(1.1), torch.tensor(0.3)
    outputs = features(layers, maps, mean, std)
    expected = by_pytorch(layers, (maps - mean) / std)
    assert torch.allclose(outputs, expected, atol=1e-4)
    weights = numbers(*expected.shape, seed=2)
    for mine, theirs in zip(
        gradients(layers, outputs, weights),
        gradients(layers, expected, weights),
        strict=True,
    ):
        assert torch.allclose(
            mine, theirs, rtol=0, atol=1e-4 * theirs.abs().max().item()
        )


def test_the_same_twice_and_apart_from_other_maps():
    """A map's features do not depend on the maps beside it, to the last bit."""
    layers, maps = layers_of(), numbers(40, 10, 10)
    outputs = features(layers, maps)
    assert torch.equal(outputs, features(layers, maps))
    assert torch.equal(outputs[7:12], features(layers, maps[7:12]))


def test_maps_and_weights_of_any_layout():
    layers, maps = layers_of(), numbers(10, 12, 6).permute(2, 0, 1)[:, :, :10].mT
    assert not maps.is_contiguous()
    assert torch.allclose(features(layers, maps), by_pytorch(layers, maps), atol=1e-5)


def test_what_is_not_a_number_stays_so():
    layers, maps = layers_of(), numbers(20, 9, 9)
    maps[3, 4, 4], maps[5, 0, 0] = float("nan"), float("inf")
    outputs = features(layers, maps)
    assert outputs[3].isnan().any() and not outputs[5].isfinite().all()
    others = [row for row in range(20) if row not in (3, 5)]
    assert outputs[others].isfinite().all()
    assert any(
        one.isnan().any()
        for one in gradients(layers, outputs, torch.ones_like(outputs))
    )


@pytest.mark.parametrize(
    ("layers", "maps"),
    [
        (layers_of((6, 4)), numbers(2, 9, 9)),
        (layers_of((8, 3)), numbers(2, 9, 9)),
        (layers_of(kernel=3), numbers(2, 9, 9)),
        (layers_of(), numbers(2, 9, 9, dtype=torch.float64)),
        (layers_of(), numbers(2, 9, 9).requires_grad_()),
        (layers_of(dtype=torch.bfloat16), numbers(2, 9, 9).bfloat16()),
    ],
    ids=[
        "first channels",
        "second channels",
        "kernel",
        "unlike types",
        "maps with a gradient",
        "bfloat16",
    ],
)
def test_what_pytorch_computes(layers, maps):
    assert not fast(layers, maps)


def test_an_encoder_is_the_same_without_numba(monkeypatch):
    network = Network(pixels=12, encoder_hidden=16, latent=8)
    encoder = Encoder(network)
    inputs = numbers(2, 5, 11)
    maps = numbers(2, 5, 12, 12).half()
    compiled = encoder(inputs, maps)
    monkeypatch.setattr(convolution, "kernels", lambda: None)
    assert torch.allclose(encoder(inputs, maps), compiled, atol=1e-5)


def test_numbers_with_a_gradient_are_pytorchs():
    layers, maps = layers_of(), numbers(2, 9, 9)
    assert not is_fast_for(layers, maps, numbers(2, 3).requires_grad_())


@pytest.mark.parametrize("where", ["threads", "autocast"])
def test_where_pytorch_is_left_to_it(where):
    layers, maps = layers_of(), numbers(2, 9, 9)
    if where == "threads":
        torch.set_num_threads(2)
        assert not fast(layers, maps)
    else:
        with torch.autocast("cpu", torch.bfloat16):
            assert not fast(layers, maps)


def test_gradients_have_the_weights_layout_or_serve_as_well():
    """Adam's fused kernel takes the same step as with PyTorch's own gradients."""
    maps, steps = numbers(20, 10, 10), []
    for work in (features, by_pytorch):
        layers = layers_of()
        optimiser = torch.optim.AdamW(layers.parameters(), lr=1e-2, fused=True)
        work(layers, maps).square().sum().backward()
        optimiser.step()
        steps.append([weights.detach().clone() for weights in layers.parameters()])
    for numba_step, torch_step in zip(*steps, strict=True):
        assert np.allclose(numba_step, torch_step, atol=1e-5)
