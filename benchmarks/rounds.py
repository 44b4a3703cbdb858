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
    """Units of work a second of this process's CPU time, one figure a round; `work` returns its units.

    `prepare` is called before each round and is not counted.
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
    what: str, rates: np.ndarray, unit: str, released: float | None = None
) -> None:
    """Print one line: median, least and most, and the ratio to the released code's figure."""
    line = f"{what:48s} {np.median(rates):9.1f} {unit} [{rates.min():.1f}, {rates.max():.1f}]"
    print(
        line + (f"  {np.median(rates) / released:.1f} x released" if released else ""),
        flush=True,
    )
