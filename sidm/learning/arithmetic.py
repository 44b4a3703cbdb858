"""How PyTorch computes inside a block: on how many threads, with which rounding, with or without denormal numbers."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import torch


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """PyTorch on one thread inside the block: results are equal bit for bit only at the same number of threads."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


@contextlib.contextmanager
def matmul_precision(precision: str) -> Iterator[None]:
    """Inside the block a GPU rounds products to TensorFloat-32 where `precision` is 'tf32', and nowhere else.

    PyTorch rounds convolutions and LSTMs by default and matrix products not. A CPU
    knows no such rounding.
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
    """Inside the block a CPU takes numbers below 1e-38 for 0.

    Gradients that fade along a trajectory, and their squares in Adam, get there; a
    processor computes with such numbers a hundred times as slowly.
    """
    before = not (torch.full((1,), 1e-40) * 1.0).item()
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(before)
