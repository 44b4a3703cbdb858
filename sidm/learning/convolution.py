"""The encoder's two convolutions on one core, three times as fast as PyTorch's.

Results differ from PyTorch's by rounding only. PyTorch pads channels to blocks of 16;
with 1, 8 and 4 channels most of its work is on padding. The compiled kernels of
`convolution_kernels` need no padding.
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
    """The compiled kernels, imported at the first call; None without Numba."""
    try:
        return importlib.import_module("sidm.learning.convolution_kernels")
    except ImportError:
        return None


def is_fast_for(layers: nn.Sequential, maps: Tensor, numbers: Tensor) -> bool:
    """Whether `features` can compute the encoder's convolutions, and is the faster way.

    PyTorch's convolutions are used on GPUs, in low precision, on several threads
    (PyTorch divides its work among them), with kernels other than 4 x 4, with numbers
    of channels that are no multiples of 4, for inputs with a gradient, and where Numba
    is not installed.
    """
    first, second = layers[0], layers[2]
    assert isinstance(first, nn.Conv2d) and isinstance(second, nn.Conv2d)
    return (
        maps.device.type == "cpu"
        and maps.dtype == numbers.dtype == first.weight.dtype
        and maps.dtype in (torch.float32, torch.float64)
        and not (maps.requires_grad or numbers.requires_grad)
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
    """Features of R x R pixels, R = P - 6, with the C channels innermost; then numbers.

    Maps (N, P, P), m, and numbers (N, X) give (N, R R C + X). `mean` and `std` are the
    maps' standardisation, m.
    """
    first, second, slope = layers[0], layers[2], layers[1].negative_slope
    constants = slope, float(mean), float(std)
    return _Convolutions.apply(
        maps, numbers, first.weight, first.bias, second.weight, second.bias, constants
    )


class _Convolutions(torch.autograd.Function):
    """Both layers; constants are the slope, the maps' mean and standard deviation."""

    @staticmethod
    def forward(ctx: Any, maps: Tensor, numbers: Tensor, *parameters: Any) -> Tensor:
        *weights, constants = parameters
        arrays = [_array(tensor) for tensor in (maps, *weights)]
        count = (maps.shape[-1] - 6) ** 2 * len(weights[-1])
        result = maps.new_empty(len(maps), count + numbers.shape[-1])
        result[:, count:] = numbers
        ctx.constants = tuple(map(arrays[0].dtype.type, constants))
        kernels().forward(*arrays, *ctx.constants, result.numpy())  # type: ignore[union-attr]
        ctx.save_for_backward(maps, *weights, result)
        return result

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        maps, *weights, result = map(_array, ctx.saved_tensors)
        first, first_bias, second, _ = weights
        gradients = [np.zeros_like(array) for array in weights]
        # a convolution from the second layer's outputs to its inputs
        flipped = np.ascontiguousarray(second.transpose(1, 0, 2, 3)[:, :, ::-1, ::-1])
        inputs = maps, first, first_bias, flipped, *ctx.constants, result
        kernels().backward(*inputs, _array(gradient), *gradients)  # type: ignore[union-attr]
        return None, None, *map(torch.from_numpy, gradients), None


def _array(tensor: Tensor) -> np.ndarray:
    """A tensor's numbers as an array, contiguous in the order of its dimensions."""
    return tensor.detach().contiguous().numpy()
