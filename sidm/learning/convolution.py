"""The encoder's two convolutions on one core: three times as fast as PyTorch's, with the same results but for rounding.

A library for networks pads channels to blocks of 16; with 1, 8 and 4 channels most of its work is on padding. The
compiled kernels of `convolution_kernels` do without.
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


def is_fast_for(layers: nn.Sequential, maps: Tensor) -> bool:
    """Whether `features` computes the encoder's convolutions of these maps.

    PyTorch's own do it on GPUs, in low precision, on several threads (PyTorch shares its work out among them), with
    other kernels than 4 x 4, with channels that are no multiples of 4, and where Numba is not installed.
    """
    first, second = layers[0], layers[2]
    assert isinstance(first, nn.Conv2d) and isinstance(second, nn.Conv2d)
    return (
        maps.device.type == "cpu"
        and maps.dtype == first.weight.dtype
        and maps.dtype in (torch.float32, torch.float64)
        and not maps.requires_grad
        and not torch.is_autocast_enabled("cpu")
        and torch.get_num_threads() == 1
        and first.kernel_size == second.kernel_size == (4, 4)
        and first.out_channels % 4 == second.out_channels % 4 == 0
        and kernels() is not None
    )


def features(layers: nn.Sequential, maps: Tensor, mean: Tensor | float = 0.0, std: Tensor | float = 1.0) -> Tensor:
    """What the convolutions and their leaky ReLUs make of maps (N, P, P) in units of `mean` and `std`.

    Returns:
        (N, R R C), the channels innermost; R = P - 6.
    """
    first, second, slope = layers[0], layers[2], layers[1].negative_slope
    units = float(mean), float(std)
    return _Convolutions.apply(maps, first.weight, first.bias, second.weight, second.bias, slope, units)


class _Convolutions(torch.autograd.Function):
    """Both layers, forward and backward; the maps have no gradient."""

    @staticmethod
    def forward(ctx: Any, maps: Tensor, *parameters: Any) -> Tensor:
        *tensors, slope, units = parameters
        arrays = [_array(tensor) for tensor in (maps, *tensors)]
        rest = maps.shape[-1] - 6
        found = np.empty((len(maps), rest * rest * len(arrays[3])), arrays[0].dtype)
        numbers = tuple(map(arrays[0].dtype.type, (slope, *units)))
        _kernels().forward(*arrays, *numbers, found)
        result = torch.from_numpy(found)
        ctx.numbers = numbers
        ctx.save_for_backward(maps, *tensors, result)
        return result

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        maps, first, first_bias, second, second_bias, result = map(_array, ctx.saved_tensors)
        given = [np.zeros_like(one) for one in (first, first_bias, second, second_bias)]
        turned = np.ascontiguousarray(second.transpose(1, 0, 2, 3)[:, :, ::-1, ::-1])  # from outputs to inputs
        _kernels().backward(maps, first, first_bias, turned, *ctx.numbers, result, _array(gradient), *given)
        return None, *map(torch.from_numpy, given), None, None


def _kernels() -> ModuleType:
    found = kernels()
    assert found is not None  # `is_fast_for` has asked
    return found


def _array(tensor: Tensor) -> np.ndarray:
    """The tensor's numbers, in the order of its dimensions."""
    return tensor.detach().contiguous().numpy()
