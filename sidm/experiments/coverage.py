"""How often 95 % intervals hold the truth: measured on synthetic studies whose data-efficiency ratio is known.

Run as a module it measures anew and writes `results/coverage.json`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sidm.experiments.statistics import MANY_SEEDS, Interval, bootstrap, efficiency, leave_one_out
from sidm.storage import read_record, write_record

MINUTES = np.array([1.0, 2, 5, 20, 60, 120])
RATIO = 4.0  # between the data that the two methods need
SLOPE = 0.25  # loss falls with data to this power
LEVEL = (RATIO * 10.0) ** -SLOPE  # the loss at which the ratio is read, inside both curves
NOISE, COMMON = 0.15, 0.1  # standard deviations of log loss: of each training, and of a seed's trainings together
SEEDS, STUDIES, RESAMPLES = (3, 10, 30), 500, 300
FILE = Path("results") / "coverage.json"


def synthetic_study(seeds: int, rng: np.random.Generator) -> np.ndarray:
    """Losses (S, 2, M) of paired seeds, SIDM's before the comparison's."""
    curves = np.stack([RATIO * MINUTES, MINUTES]) ** -SLOPE
    common, own = rng.normal(0, COMMON, (seeds, 1, 1)), rng.normal(0, NOISE, (seeds, *curves.shape))
    return curves * np.exp(common + own)


def log_ratio(pairs: np.ndarray) -> float:
    """Logarithm of the data-efficiency ratio at LEVEL of the mean curves of losses (S, 2, M)."""
    sidm, novice_only = pairs.mean(0)
    return float(np.log(efficiency(MINUTES, sidm, novice_only, np.array([LEVEL])).ratio[0]))


def by_resampling(pairs: np.ndarray) -> Interval:
    """The percentile interval of `log_ratio`."""
    return bootstrap(log_ratio, pairs, resamples=RESAMPLES)


def by_leaving_out(pairs: np.ndarray) -> Interval:
    """Student's interval of `log_ratio`."""
    return leave_one_out(log_ratio, pairs)


def coverage(method: Callable[[np.ndarray], Interval], seeds: int, studies: int = STUDIES) -> tuple[float, float]:
    """Share of synthetic studies whose interval holds the true ratio, and the intervals' median width in log ratio."""
    rng = np.random.default_rng(seeds)
    found = [method(synthetic_study(seeds, rng)) for _ in range(studies)]
    held = [one.low <= np.log(RATIO) <= one.high for one in found]
    return float(np.mean(held)), float(np.median([one.high - one.low for one in found]))


def measure(seeds: Sequence[int] = SEEDS) -> dict[str, Any]:
    """Coverage and width by method and number of seeds."""
    methods = {"percentile": by_resampling, "leave_one_out": by_leaving_out}
    return {name: {str(n): [round(x, 4) for x in coverage(one, n)] for n in seeds} for name, one in methods.items()}


def coverage_note(file: Path = FILE) -> str:
    """What the stored measurement says of the intervals in a table, as a sentence."""
    found = read_record(file)
    shares = {n: (found["percentile"][n][0], found["leave_one_out"][n][0]) for n in found["percentile"]}
    parts = [f"with {n} seeds {100 * one:.0f} % and {100 * other:.0f} %" for n, (one, other) in shares.items()]
    return (
        f"How often 95 % intervals hold the true ratio, in {STUDIES} synthetic studies each: percentiles of resampled "
        f"seeds and Student's with one seed left out, {'; '.join(parts)}. "
        f"Below {MANY_SEEDS} seeds the tables have the latter."
    )


if __name__ == "__main__":
    write_record(FILE, measure())
