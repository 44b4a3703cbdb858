"""Several rounds of a measurement: median and spread."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np


def rate(
    work: Callable[[], int],
    prepare: Callable[[], object] = lambda: None,
    rounds: int = 7,
) -> np.ndarray:
    """Units of work a second of this process's CPU time, one value a round.

    `work` returns its units of work. `prepare` is called before each round, and its
    time is not counted.
    """
    prepare()
    work()  # warm up
    rates = []
    for _ in range(rounds):
        prepare()
        start = time.process_time()
        units = work()
        rates.append(units / (time.process_time() - start))
    return np.array(rates)


def report(
    name: str, rates: np.ndarray, unit: str, released: float | None = None
) -> None:
    """Print a line: median, least and most rate, and their median over `released`."""
    median = np.median(rates)
    line = f"{name:48s} {median:9.1f} {unit} [{rates.min():.1f}, {rates.max():.1f}]"
    line += f"  {median / released:.1f} x released" if released else ""
    print(line, flush=True)
