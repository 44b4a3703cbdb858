"""Settings of PyTorch inside a block: threads, rounding and denormal numbers."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import torch


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """PyTorch computes on one thread: results are equal bit for bit only then."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


@contextlib.contextmanager
def matmul_precision(precision: str) -> Iterator[None]:
    """A GPU rounds products to TensorFloat-32 inside the block only with 'tf32'.

    PyTorch's default is to round convolutions and LSTMs but not matrix products. A CPU
    never rounds to TensorFloat-32.
    """
    matrices, networks = torch.backends.cuda.matmul, torch.backends.cudnn
    before = matrices.allow_tf32, networks.allow_tf32
    matrices.allow_tf32 = networks.allow_tf32 = precision == "tf32"
    try:
        yield
    finally:
        matrices.allow_tf32, networks.allow_tf32 = before


@contextlib.contextmanager
def flushed_denormals() -> Iterator[None]:
    """A CPU replaces numbers below 1e-38 by 0 inside the block.

    Gradients that fade along a trajectory become so small, and so do their squares in
    Adam; a processor is a hundred times slower with such denormal numbers.
    """
    before = not (torch.full((1,), 1e-40) * 1.0).item()
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(before)
