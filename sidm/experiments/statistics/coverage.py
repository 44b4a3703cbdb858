"""How often 95 % intervals hold the truth: measured on synthetic studies whose data-efficiency ratio is known.

Beside it stands how often the greatest of a study's ratios looks like a saving where nothing is saved: it is picked
after the fact, which no interval knows of.

Run as a module it measures anew and writes `results/coverage.json`.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from sidm.experiments.statistics.efficiency import efficiency, greatest_ratio, known
from sidm.experiments.statistics.intervals import Interval, bootstrap, interval, leave_one_out
from sidm.storage import read_record, write_record

MINUTES = np.array([1.0, 2, 5, 20, 60, 120])
RATIO = 4.0  # between the data that the two methods need
SLOPE = 0.25  # loss falls with data to this power
LEVEL = (RATIO * 10.0) ** -SLOPE  # the loss at which the ratio is read, inside both curves
NOISE, COMMON = 0.15, 0.1  # standard deviations of log loss: of each training, and of a seed's trainings together
FIGURE3_NOISE = 0.04, 0.03  # the same, about as in Figure 3
FIGURE3_SEEDS = 5  # of the preset `study` at every size
SEEDS, STUDIES, RESAMPLES = (3, FIGURE3_SEEDS, 10, 30), 500, 300
FILE = Path("results") / "coverage.json"


def synthetic_study(
    seeds: int, rng: np.random.Generator, ratio: float = RATIO, noise: tuple[float, float] = (NOISE, COMMON)
) -> np.ndarray:
    """Losses (S, 2, M) of paired seeds, SIDM's before the comparison's, which needs `ratio` times the data."""
    curves = np.stack([ratio * MINUTES, MINUTES]) ** -SLOPE
    common, own = rng.normal(0, noise[1], (seeds, 1, 1)), rng.normal(0, noise[0], (seeds, *curves.shape))
    return curves * np.exp(common + own)


def log_ratio(pairs: np.ndarray) -> float:
    """Logarithm of the data-efficiency ratio at LEVEL of the mean curves of losses (S, 2, M)."""
    sidm, novice_only = pairs.mean(0)
    return float(np.log(efficiency(MINUTES, sidm, novice_only, np.array([LEVEL])).ratio[0]))


#: Kind of interval -> that of `log_ratio` over the S seeds of losses (S, 2, M).
METHODS: dict[str, Callable[[np.ndarray], Interval]] = {
    "percentile": functools.partial(bootstrap, log_ratio, resamples=RESAMPLES),
    "leave_one_out": functools.partial(leave_one_out, log_ratio),  # Student's
}


def coverage(method: Callable[[np.ndarray], Interval], seeds: int) -> tuple[float, float]:
    """Share of synthetic studies (S, 2, M) whose interval holds the true ratio, and the median width in log ratio."""
    rng = np.random.default_rng(seeds)
    found = [method(synthetic_study(seeds, rng)) for _ in range(STUDIES)]
    held = [one.low <= np.log(RATIO) <= one.high for one in found]
    return float(np.mean(held)), float(np.median([one.high - one.low for one in found]))


def nothing_saved(seeds: int) -> tuple[float, float]:
    """Share of synthetic studies that save nothing whose greatest ratio still lies above 1 with its whole interval.

    Returns:
        The share, and the median greatest ratio of those where it is no bound.
    """
    rng = np.random.default_rng(seeds)
    found = []
    for _ in range(STUDIES):
        study = synthetic_study(seeds, rng, ratio=1.0, noise=FIGURE3_NOISE)
        if np.isfinite(log_greatest(study)):
            found.append(interval(log_greatest, study))
    return float(np.sum([one.low > 0 for one in found]) / STUDIES), float(np.exp(np.median([f.value for f in found])))


def log_greatest(pairs: np.ndarray) -> float:
    """Logarithm of the greatest ratio over the M sizes of losses (S, 2, M), NaN where it is a bound."""
    return known(*greatest_ratio(MINUTES, pairs))


def measure(seeds: Sequence[int] = SEEDS) -> dict[str, Any]:
    """Coverage and width by method and number of seeds, and what looks like a saving where there is none."""
    found: dict[str, Any] = {
        name: {str(n): [round(x, 4) for x in coverage(one, n)] for n in seeds} for name, one in METHODS.items()
    }
    return found | {"nothing_saved": [round(x, 4) for x in nothing_saved(FIGURE3_SEEDS)]}


def table(file: Path = FILE) -> pd.DataFrame:
    """As stored: the `share` of 95 % intervals that hold the true ratio, a line a method and number of seeds."""
    found = read_record(file)
    lines = [(name, int(n), *one) for name in METHODS for n, one in found[name].items()]
    return pd.DataFrame(lines, columns=["interval", "seeds", "share", "width"])


def greatest(file: Path = FILE) -> tuple[float, float]:
    """As `nothing_saved`, as it is stored."""
    share, median = read_record(file)["nothing_saved"]
    return share, median


if __name__ == "__main__":
    write_record(FILE, measure())
