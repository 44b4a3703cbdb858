"""Numbers as few bytes that a browser unpacks: what moves changes steadily, so little of it need be said.

`unpack` here and in static/replay.js are each other's twins; tests hold them together.
"""

from __future__ import annotations

import base64
import zlib

import numpy as np


def pack(numbers: np.ndarray) -> bytes:
    """Series (..., T, C) int16 as few bytes: deflated, channel by channel.

    Of every number comes the change of its change along T, wrapped to 16 bits, with the
    sign in the lowest bit; first the low bytes of all, then the high ones, which are
    mostly 0.
    """
    bends = np.moveaxis(numbers, -1, 0).astype(np.int16)
    for _ in range(2):
        bends = np.diff(bends, axis=-1, prepend=np.int16(0))
    zigzag = ((bends << 1) ^ (bends >> 15)).astype("<u2")
    return zlib.compress(
        (zigzag & 255).astype(np.uint8).tobytes()
        + (zigzag >> 8).astype(np.uint8).tobytes(),
        9,
    )


def unpack(content: bytes, shape: tuple[int, ...]) -> np.ndarray:
    """Series of that shape (..., T, C), int16, of what `pack` made of them."""
    low, high = (
        np.frombuffer(zlib.decompress(content), np.uint8)
        .reshape(2, shape[-1], *shape[:-1])
        .astype(np.uint16)
    )
    zigzag = low | high << 8
    bends = ((zigzag >> 1) ^ -(zigzag & 1)).astype(np.int16)
    return np.moveaxis(
        bends.cumsum(axis=-1, dtype=np.int16).cumsum(axis=-1, dtype=np.int16), 0, -1
    )


def text(content: bytes) -> str:
    """Bytes as they stand in a script."""
    return base64.b64encode(content).decode()
