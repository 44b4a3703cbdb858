"""Separate streams of random numbers from one seed, one for each purpose."""

from __future__ import annotations

import hashlib

import numpy as np
import torch


def derive(seed: int, purpose: str) -> int:
    """A seed for `purpose`, independent of the seeds for other purposes."""
    digest = hashlib.sha256(purpose.encode()).digest()[:16]
    spawn_key = tuple(np.frombuffer(digest, np.uint32).tolist())
    low, high = np.random.SeedSequence(seed, spawn_key=spawn_key).generate_state(2)
    return int(high) >> 1 << 32 | int(low)


def generator(seed: int, purpose: str) -> torch.Generator:
    """A generator on the CPU whose numbers depend on `seed` and `purpose` alone."""
    return torch.Generator().manual_seed(derive(seed, purpose))
