"""How often 95 % intervals hold the truth: measured on synthetic studies whose data-efficiency ratio is known.

First for two kinds of interval, then for each estimator that a page or a verdict uses,
at a size fixed before.

Run as a module it measures anew and writes `results/coverage.json`.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from companion.statistics.data_ratio import data_ratio
from companion.statistics.efficiency import efficiency
from companion.statistics.intervals import (
    Interval,
    bootstrap,
    leave_one_out,
    mean_ratio,
    ratio_of_means,
)
from companion.statistics.pairs import Losses
from companion.statistics.savings import savings_between
from sidm.storage import read_record, write_record

MINUTES = np.array([1.0, 2, 5, 20, 60, 120])
RATIO = 4.0  # between the data that the two methods need
SLOPE = 0.25  # loss falls with data to this power
#: the loss at which the ratio is read, inside both curves
LEVEL = (RATIO * 10.0) ** -SLOPE
#: standard deviations of log loss: of each training, and of a seed's trainings together
NOISE, COMMON = 0.15, 0.1
FIGURE3_NOISE = 0.04, 0.03  # the same, about as in Figure 3
SEEDS, STUDIES, RESAMPLES = (3, 5, 10, 30), 500, 300
#: seeds of a study, and what its estimators are held against
ESTIMATED_SEEDS, TRUTHS = (5, 10), (1.0, 3.0, 20.0)
AT = 2  # which of MINUTES: 5
FILE = Path("results") / "coverage.json"


def synthetic_study(
    seeds: int,
    rng: np.random.Generator,
    ratio: float = RATIO,
    noise: tuple[float, float] = (NOISE, COMMON),
) -> np.ndarray:
    """Losses (S, 2, M) of paired seeds, SIDM's before the comparison's, which needs `ratio` times the data."""
    curves = np.stack([ratio * MINUTES, MINUTES]) ** -SLOPE
    common, own = (
        rng.normal(0, noise[1], (seeds, 1, 1)),
        rng.normal(0, noise[0], (seeds, *curves.shape)),
    )
    return curves * np.exp(common + own)


def log_ratio(pairs: np.ndarray) -> float:
    """Logarithm of the data-efficiency ratio at LEVEL of the mean curves of losses (S, 2, M)."""
    sidm, novice_only = pairs.mean(0)
    return float(
        np.log(efficiency(MINUTES, sidm, novice_only, np.array([LEVEL])).ratio[0])
    )


#: Kind of interval -> that of `log_ratio` over the S seeds of losses (S, 2, M).
METHODS: dict[str, Callable[[np.ndarray], Interval]] = {
    "percentile": functools.partial(bootstrap, log_ratio, resamples=RESAMPLES),
    "leave_one_out": functools.partial(leave_one_out, log_ratio),  # Student's
}


def coverage(
    method: Callable[[np.ndarray], Interval], seeds: int
) -> tuple[float, float]:
    """Share of synthetic studies (S, 2, M) whose interval holds the true ratio, and the median width in log ratio."""
    rng = np.random.default_rng(seeds)
    found = [method(synthetic_study(seeds, rng)) for _ in range(STUDIES)]
    held = [one.low <= np.log(RATIO) <= one.high for one in found]
    return float(np.mean(held)), float(np.median([one.high - one.low for one in found]))


def of_mean_curves(study: np.ndarray) -> tuple[float, float]:
    """The interval of `savings` at 5 min, of losses (S, 2, M): SIDM's before the comparison's."""
    seeds = np.arange(len(study))
    own, other = (Losses(MINUTES, study[:, [side]], seeds) for side in (0, 1))
    return savings_between(own, other)[AT][4:6]


def by_seed(study: np.ndarray) -> tuple[float, float]:
    """The interval of `data_ratio` at 5 min."""
    return data_ratio(MINUTES.tolist(), study[:, 1], study[:, 0, AT], MINUTES[AT])[1:]


#: Estimator -> its interval from losses (S, 2, M), and what it is of: the data ratio,
#: or the ratio of losses at 5 min.
ESTIMATORS: dict[
    str, tuple[Callable[[np.ndarray], Sequence[float]], Callable[[float], float]]
] = {
    "data ratio of mean curves": (of_mean_curves, float),
    "data ratio by seed": (by_seed, float),
    "ratio of mean losses": (
        lambda study: ratio_of_means(study[:, ::-1, AT])[1:],
        lambda ratio: ratio**-SLOPE,
    ),
    "mean ratio of losses": (
        lambda study: mean_ratio(study[:, :1, AT], study[:, 1:, AT])[1:],
        lambda ratio: ratio**-SLOPE,
    ),
}


def estimated(name: str, ratio: float, seeds: int) -> tuple[float, float, float]:
    """Of an estimator on studies with a data ratio: the share of its intervals that hold the truth.

    Returns:
        The share, that of the intervals that lie above the truth, and that of studies
        without an interval.
    """
    ends_of, truth_of = ESTIMATORS[name]
    rng, truth = np.random.default_rng([seeds, round(10 * ratio)]), truth_of(ratio)
    ends = np.array(
        [
            ends_of(synthetic_study(seeds, rng, ratio, FIGURE3_NOISE))
            for _ in range(STUDIES)
        ]
    )
    there = ends[np.isfinite(ends[:, 0])]
    held = (there[:, 0] <= truth) & (truth <= there[:, 1])
    return (
        float(held.mean()),
        float((there[:, 0] > truth).mean()),
        1 - len(there) / STUDIES,
    )


def measure(seeds: Sequence[int] = SEEDS) -> dict[str, Any]:
    """Coverage and width by kind of interval and number of seeds, and coverage of each estimator."""
    found: dict[str, Any] = {
        name: {str(n): [round(x, 4) for x in coverage(one, n)] for n in seeds}
        for name, one in METHODS.items()
    }
    lines = [
        (name, ratio, n)
        for name in ESTIMATORS
        for ratio in TRUTHS
        for n in ESTIMATED_SEEDS
    ]
    return found | {
        "estimators": [
            [*line, *(round(x, 4) for x in estimated(*line))] for line in lines
        ]
    }


def table(file: Path = FILE) -> pd.DataFrame:
    """As stored: the `share` of 95 % intervals that hold the true ratio, a line a method and number of seeds."""
    found = read_record(file)
    lines = [(name, int(n), *one) for name in METHODS for n, one in found[name].items()]
    return pd.DataFrame(lines, columns=["interval", "seeds", "share", "width"])


def estimators(file: Path = FILE) -> pd.DataFrame:
    """As stored: the `share` of intervals that hold the truth, and of those `above` it, a line an estimator and truth.

    `ratio` is the data ratio of the synthetic studies; `open`, the share of studies
    without an interval.
    """
    names = ["estimator", "ratio", "seeds", "share", "above", "open"]
    return pd.DataFrame(read_record(file)["estimators"], columns=names)


def make(study: Any, workers: int) -> None:
    """`companion run --figure coverage`, in one process."""
    write_record(Path(study.results) / FILE.name, measure())
