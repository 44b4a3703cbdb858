"""LSTM layers and convolutions of a bundle by the kernels of `kernels`.

They compute what `models.recurrence` and the encoder's layers do, in float32. M trials,
B trajectories, T steps, H hidden units; N = M B trajectories, P map pixels a side.
"""

from __future__ import annotations

import functools
import importlib.util

import torch
from torch import Tensor, nn
from torch.autograd.function import once_differentiable

BATCHES = (2, 4, 8)  # trajectories of a trial for which a step is one kernel
#: The kernels take numbers of channels and of hidden units that are multiples of these.
CHANNEL_MULTIPLE, HIDDEN_MULTIPLE = 4, 64


@functools.cache
def has_triton() -> bool:
    """Whether Triton is installed; PyTorch brings it where it supports GPUs."""
    return importlib.util.find_spec("triton") is not None


def fits_kernels(tensor: Tensor) -> bool:
    """Whether the kernels compute with a tensor: float32 on a GPU."""
    return tensor.is_cuda and tensor.dtype == torch.float32 and has_triton()


def fuses_steps(inputs: Tensor) -> bool:
    """Whether the kernels compute an LSTM layer with inputs (M, T, B, 4 H)."""
    *_, batch, width = inputs.shape
    return (
        fits_kernels(inputs) and batch in BATCHES and width % (4 * HIDDEN_MULTIPLE) == 0
    )


def fuses_convolutions(layers: nn.Module, maps: Tensor) -> bool:
    """Whether the kernels compute the encoder's layers on maps (N, T, 1, P, P)."""
    if not fits_kernels(maps):
        return False
    convolutions = [
        layer for layer in layers.children() if isinstance(layer, nn.Conv2d)
    ]
    return len(convolutions) == 2 and all(
        layer.kernel_size == (4, 4) and layer.out_channels % CHANNEL_MULTIPLE == 0
        for layer in convolutions
    )


class FusedRecurrence(torch.autograd.Function):
    """An LSTM layer over all steps, as `models.recurrence`."""

    @staticmethod
    def forward(ctx, inputs: Tensor, recurrent: Tensor) -> Tensor:
        """Hidden states (M, T, B, H) from gates (M, T, B, 4 H), weights (M, 4 H, H)."""
        from companion.bundle.kernels.recurrence import lstm_forward

        gates, hidden, cells = lstm_forward(inputs.contiguous(), recurrent)
        ctx.save_for_backward(gates, hidden, cells, recurrent)
        return hidden[:, 1:]

    @staticmethod
    @once_differentiable
    def backward(ctx, hidden_gradient: Tensor) -> tuple[Tensor, Tensor]:
        """Gradients of both inputs of `forward`."""
        from companion.bundle.kernels.recurrence import lstm_backward

        gates, hidden, cells, recurrent = ctx.saved_tensors
        gradients = lstm_backward(
            hidden_gradient.contiguous(), recurrent.contiguous(), gates, cells
        )[:, :-1]
        before = hidden[:, :-1].flatten(1, 2)  # (M, T B, H)
        return gradients, gradients.flatten(1, 2).mT @ before


class FusedConvolutions(torch.autograd.Function):
    """Both convolutions of the encoder, each with its leaky rectifier."""

    @staticmethod
    def forward(ctx, maps: Tensor, slope: float, *weights: Tensor) -> Tensor:
        """Features (N, T, 4 (P - 6)^2) of maps, the channel last in each pixel.

        Args:
            ctx: autograd's context.
            maps: (N, T, 1, P, P), standardised; they have no gradient.
            slope: of the rectifiers below zero.
            *weights: kernels (N, C, 1, 4, 4), biases (N, C), kernels (N, D, C, 4, 4),
                biases (N, D).
        """
        from companion.bundle.kernels.convolution import convolve

        maps = maps.contiguous()
        kernels1, bias1, kernels2, bias2 = (part.contiguous() for part in weights)
        hidden = convolve(maps, kernels1, bias1, slope, channels_last=False)
        features = convolve(hidden, kernels2, bias2, slope, channels_last=True)
        ctx.save_for_backward(maps, hidden, features, kernels2)
        ctx.slope = slope
        return features.flatten(2)

    @staticmethod
    @once_differentiable
    def backward(ctx, features_gradient: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients of the kernels and biases."""
        from companion.bundle.kernels.convolution import (
            convolve_backward,
            kernel_gradient,
        )

        maps, hidden, features, kernels2 = ctx.saved_tensors
        gradient = features_gradient.view_as(features)
        gradient = torch.where(features > 0, gradient, ctx.slope * gradient)
        gradient = gradient.movedim(-1, 2).contiguous()  # (N, T, D, P - 6, P - 6)
        earlier = convolve_backward(gradient, kernels2, hidden, ctx.slope)
        return (
            None,
            None,
            kernel_gradient(earlier, maps),
            earlier.sum((1, 3, 4)),
            kernel_gradient(gradient, hidden),
            gradient.sum((1, 3, 4)),
        )
