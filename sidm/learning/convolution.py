"""The encoder's two convolutions on one core: three times as fast as PyTorch's, with the same results but for rounding.

A library for networks pads channels to blocks of 16; with 1, 8 and 4 channels most of
its work is on padding. The compiled kernels of `convolution_kernels` do without.
"""

from __future__ import annotations

import functools
import importlib
from types import ModuleType
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.autograd.function import once_differentiable


@functools.cache
def kernels() -> ModuleType | None:
    """The compiled kernels, imported when they are first needed; None where Numba is not installed."""
    try:
        return importlib.import_module("sidm.learning.convolution_kernels")
    except ImportError:
        return None


def is_fast_for(layers: nn.Sequential, maps: Tensor, numbers: Tensor) -> bool:
    """Whether `features` computes the encoder's convolutions of these maps.

    PyTorch's own do it on GPUs, in low precision, on several threads (PyTorch shares
    its work out among them), with other kernels than 4 x 4, with channels that are no
    multiples of 4, for inputs with a gradient, and where Numba is not installed.
    """
    first, second = layers[0], layers[2]
    assert isinstance(first, nn.Conv2d) and isinstance(second, nn.Conv2d)
    return (
        maps.device.type == "cpu"
        and maps.dtype == numbers.dtype == first.weight.dtype
        and maps.dtype in (torch.float32, torch.float64)
        and not (maps.requires_grad or numbers.requires_grad)
        and not torch.is_autocast_enabled("cpu")
        and torch.get_num_threads() == 1
        and first.kernel_size == second.kernel_size == (4, 4)
        and first.out_channels % 4 == second.out_channels % 4 == 0
        and kernels() is not None
    )


def features(
    layers: nn.Sequential,
    maps: Tensor,
    numbers: Tensor,
    mean: Tensor | float = 0.0,
    std: Tensor | float = 1.0,
) -> Tensor:
    """What the convolutions and their leaky ReLUs make of maps, with numbers behind it.

    Args:
        layers: the two convolutions, a leaky ReLU behind each.
        maps: (N, P, P), without a gradient.
        numbers: (N, X), the same.
        mean: of the unit in which the convolutions see the maps.
        std: of the same.

    Returns:
        (N, R R C + X), the C channels innermost, R = P - 6.
    """
    first, second, slope = layers[0], layers[2], layers[1].negative_slope
    units = slope, float(mean), float(std)
    return _Convolutions.apply(
        maps, numbers, first.weight, first.bias, second.weight, second.bias, units
    )


class _Convolutions(torch.autograd.Function):
    """Both layers, forward and backward; `units` are the slope and the maps' mean and standard deviation."""

    @staticmethod
    def forward(ctx: Any, maps: Tensor, numbers: Tensor, *parameters: Any) -> Tensor:
        *weights, units = parameters
        arrays = [_array(tensor) for tensor in (maps, *weights)]
        count = (maps.shape[-1] - 6) ** 2 * len(weights[-1])
        result = maps.new_empty(len(maps), count + numbers.shape[-1])
        result[:, count:] = numbers
        ctx.units = tuple(map(arrays[0].dtype.type, units))
        kernels().forward(*arrays, *ctx.units, result.numpy())  # type: ignore[union-attr]
        ctx.save_for_backward(maps, *weights, result)
        return result

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        maps, first, first_bias, second, _, result = map(_array, ctx.saved_tensors)
        given = [np.zeros_like(_array(one)) for one in ctx.saved_tensors[1:5]]
        # from outputs to inputs
        turned = np.ascontiguousarray(second.transpose(1, 0, 2, 3)[:, :, ::-1, ::-1])
        kernels().backward(  # type: ignore[union-attr]
            maps,
            first,
            first_bias,
            turned,
            *ctx.units,
            result,
            _array(gradient),
            *given,
        )
        return None, None, *map(torch.from_numpy, given), None


def _array(tensor: Tensor) -> np.ndarray:
    """The tensor's numbers, in the order of its dimensions."""
    return tensor.detach().contiguous().numpy()
