"""Separate streams of random numbers from one seed, one for each purpose."""

from __future__ import annotations

import hashlib

import numpy as np
import torch


def derive(seed: int, purpose: str) -> int:
    """A seed for `purpose`, independent of those for other purposes."""
    words = np.frombuffer(hashlib.sha256(purpose.encode()).digest()[:16], np.uint32)
    low, high = np.random.SeedSequence(
        seed, spawn_key=tuple(int(word) for word in words)
    ).generate_state(2)
    return int(high) >> 1 << 32 | int(low)


def generator(seed: int, purpose: str) -> torch.Generator:
    """A generator on the CPU whose numbers depend on `seed` and `purpose` alone."""
    return torch.Generator().manual_seed(derive(seed, purpose))
