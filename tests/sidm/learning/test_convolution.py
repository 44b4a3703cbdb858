"""The encoder's convolutions in Numba against PyTorch's."""

import pytest
import torch
from torch import nn

from sidm.learning import Encoder, Network, convolution
from sidm.learning.arithmetic import one_thread
from sidm.learning.networks import seeded

#: tolerance: sums of up to about 50,000 products run in another order
ROUNDING = {torch.float32: 1e-4, torch.float64: 1e-12}


@pytest.fixture(autouse=True)
def on_one_thread():
    with one_thread():
        yield


def layers_of(channels=(8, 4), kernel=4, dtype=torch.float32, slope=0.01):
    network = Network(channels=channels, kernel=kernel, slope=slope)
    return seeded(0, "encoder", lambda: Encoder(network)).convolutions.to(dtype)


def numbers(*shape, dtype=torch.float32, seed=1) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(*shape, generator=generator, dtype=torch.float64).to(dtype)


def features(layers: nn.Sequential, maps: torch.Tensor) -> torch.Tensor:
    """Features of maps; the numbers that stand behind them must stay."""
    beside = numbers(len(maps), 3, dtype=maps.dtype, seed=3)
    outputs = convolution.features(layers, maps, beside, 0.1, 0.3)
    assert torch.equal(outputs[:, -3:], beside)
    return outputs[:, :-3]


def fast(layers: nn.Sequential, maps: torch.Tensor, **numbers_have) -> bool:
    beside = torch.zeros(len(maps), 3, dtype=maps.dtype, **numbers_have)
    return convolution.is_fast_for(layers, maps, beside)


def gradients(layers: nn.Sequential, outputs: torch.Tensor) -> list[torch.Tensor]:
    weights = numbers(*outputs.shape, dtype=outputs.dtype, seed=2)
    return list(torch.autograd.grad(outputs, list(layers.parameters()), weights))


@pytest.mark.parametrize("dtype", ROUNDING, ids=str)
@pytest.mark.parametrize(
    ("count", "pixels", "channels", "slope"),
    [
        (1, 7, (8, 4), 0.01),
        (33, 12, (4, 4), 0.5),
        (130, 32, (8, 4), 0.01),
        (20, 16, (4, 8), 0.0),
        (3, 11, (16, 12), 0.01),
    ],
)
def test_features_and_gradients_are_pytorchs(count, pixels, channels, slope, dtype):
    layers = layers_of(channels, dtype=dtype, slope=slope)
    maps = numbers(pixels, pixels, count, dtype=dtype).permute(2, 1, 0)
    assert fast(layers, maps)  # whatever the layout of the maps
    outputs = features(layers, maps)
    again = features(layers, maps[count // 2 :])
    assert torch.equal(outputs[count // 2 :], again)  # whatever stands beside a map
    expected = layers(((maps - 0.1) / 0.3)[:, None]).movedim(1, -1).flatten(1)
    found, wanted = gradients(layers, outputs), gradients(layers, expected)
    for mine, theirs in zip([outputs, *found], [expected, *wanted], strict=True):
        assert mine.dtype == dtype
        allowed = ROUNDING[dtype] * theirs.abs().max().item()
        assert torch.allclose(mine, theirs, rtol=0, atol=allowed)


def test_where_pytorch_is_left_to_it():
    layers, maps = layers_of(), numbers(2, 9, 9)
    assert fast(layers, maps) and not fast(layers, maps, requires_grad=True)
    for others in (layers_of((6, 4)), layers_of((8, 3)), layers_of(kernel=3)):
        assert not fast(others, maps)
    assert not fast(layers, maps.double())
    assert not fast(layers, maps.clone().requires_grad_())
    torch.set_num_threads(2)
    assert not fast(layers, maps)


def test_an_encoder_is_the_same_without_numba(monkeypatch):
    encoder = Encoder(Network(pixels=12, encoder_hidden=16, latent=8))
    motion = numbers(2, 5, 11), numbers(2, 5, 12, 12).half()
    compiled = encoder(*motion)
    monkeypatch.setattr(convolution, "kernels", lambda: None)
    assert torch.allclose(encoder(*motion), compiled, atol=1e-5)
