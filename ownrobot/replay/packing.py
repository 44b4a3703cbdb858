"""Compression of time series into few bytes, which a browser can unpack.

`unpack` here and `unpack` in static/replay.js do the same; tests compare them.
"""

from __future__ import annotations

import base64
import zlib

import numpy as np


def pack(numbers: np.ndarray) -> bytes:
    """Compress series (..., T, C) int16 with deflate, channel by channel.

    Motion changes steadily, so second differences along T are small. They are wrapped
    to 16 bits, and the sign is moved to the lowest bit (zigzag). The low bytes of all
    numbers come first, then the high bytes, which are mostly 0.
    """
    second = np.moveaxis(numbers, -1, 0).astype(np.int16)
    for _ in range(2):
        second = np.diff(second, axis=-1, prepend=np.int16(0))
    zigzag = ((second << 1) ^ (second >> 15)).astype("<u2")
    planes = np.stack([zigzag & 255, zigzag >> 8]).astype(np.uint8)
    return zlib.compress(planes.tobytes(), 9)


def unpack(content: bytes, shape: tuple[int, ...]) -> np.ndarray:
    """Series of this shape (..., T, C), int16, from the bytes that `pack` returned."""
    planes = np.frombuffer(zlib.decompress(content), np.uint8)
    low, high = planes.reshape(2, shape[-1], *shape[:-1]).astype(np.uint16)
    zigzag = low | high << 8
    numbers = ((zigzag >> 1) ^ -(zigzag & 1)).astype(np.int16)
    for _ in range(2):
        numbers = numbers.cumsum(axis=-1, dtype=np.int16)
    return np.moveaxis(numbers, 0, -1)


def text(content: bytes) -> str:
    """Bytes as base64 text, which a script can hold."""
    return base64.b64encode(content).decode()
