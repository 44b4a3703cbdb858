"""What rounding a GPU may do to products of single precision."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import torch


@contextlib.contextmanager
def products(precision: str) -> Iterator[None]:
    """Inside the block products are rounded to TensorFloat-32 where `precision` is 'tf32', and nowhere else.

    PyTorch rounds convolutions and LSTMs by default and matrix products not. A CPU knows no such rounding.
    """
    matrices, networks = torch.backends.cuda.matmul, torch.backends.cudnn
    before = matrices.allow_tf32, networks.allow_tf32
    matrices.allow_tf32 = networks.allow_tf32 = precision == "tf32"
    try:
        yield
    finally:
        matrices.allow_tf32, networks.allow_tf32 = before
