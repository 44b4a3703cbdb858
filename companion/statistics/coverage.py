"""Coverage: how often 95 % intervals hold the true value.

Coverage is measured on synthetic studies whose data-efficiency ratio is known: first
for two kinds of interval, then for each estimator that a page or a verdict uses, at a
size chosen before.

`companion run --figure coverage` measures it and writes `results/coverage.json`.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from companion.statistics.intervals import (
    bootstrap,
    leave_one_out,
    mean_ratio,
    ratio_of_means,
)
from companion.statistics.pairs import Losses
from companion.statistics.savings import (
    data_ratio,
    isotonic_fit,
    minutes_needed,
    savings_between,
)
from ownrobot.comparison.statistics import Interval
from sidm.storage import read_record

MINUTES = np.array([1.0, 2, 5, 20, 60, 120])
RATIO = 4.0  # between the data that the two methods need
SLOPE = 0.25  # the loss falls with this power of the data
#: Loss at which the ratio is read, inside the range of both curves.
LEVEL = (RATIO * 10.0) ** -SLOPE
#: Standard deviations of the logarithm of the loss: of each training, and common to all
#: trainings of a seed.
NOISE, COMMON = 0.15, 0.1
FIGURE3_NOISE = 0.04, 0.03  # the two standard deviations, about as in Figure 3
#: The same with the released recipe, whose trainings have 0.05 to 0.13 on system 1; two
#: of five of its rivals with 120 min end higher, by this logarithm of the loss.
RELEASED_NOISE, HIGHER, SHARE_HIGHER = (0.09, 0.0), 0.2, 0.4
SEEDS, STUDIES, RESAMPLES = (3, 5, 10, 30), 500, 300
#: Numbers of seeds, and true data ratios, of the studies for the estimators.
ESTIMATED_SEEDS, TRUTHS = (5, 10), (1.0, 3.0, 20.0)
SIZE = 2  # index in MINUTES of the size of the estimators: 5 min
FILE = Path("results") / "coverage.json"


def synthetic_study(
    seeds: int,
    rng: np.random.Generator,
    ratio: float = RATIO,
    noise: tuple[float, float] = (NOISE, COMMON),
) -> np.ndarray:
    """Losses (S, 2, M) of S seeds: SIDM first, then what needs `ratio` times its data.

    The standard deviations of the logarithm of the loss are those of each training and
    one that is common to a seed.
    """
    curves = np.stack([ratio * MINUTES, MINUTES]) ** -SLOPE
    common = rng.normal(0, noise[1], (seeds, 1, 1))
    each = rng.normal(0, noise[0], (seeds, *curves.shape))
    return curves * np.exp(common + each)


def released_study(seeds: int, rng: np.random.Generator, ratio: float) -> np.ndarray:
    """Losses of a `synthetic_study` with the noise of the released recipe."""
    losses = synthetic_study(seeds, rng, ratio, RELEASED_NOISE)
    higher = HIGHER * (rng.random(seeds) < SHARE_HIGHER)
    losses[:, 1, -1] *= np.exp(higher - HIGHER * SHARE_HIGHER)
    return losses


def log_ratio(pairs: np.ndarray) -> float:
    """Logarithm of the data-efficiency ratio at LEVEL of mean curves, of (S, 2, M)."""
    sidm, other = (
        minutes_needed(MINUTES, isotonic_fit(curve), LEVEL)[0]
        for curve in pairs.mean(0)
    )
    return float(np.log(other / sidm))


#: Kind of interval -> interval of `log_ratio` over the S seeds of losses (S, 2, M).
METHODS: dict[str, Callable[[np.ndarray], Interval]] = {
    "percentile": functools.partial(bootstrap, log_ratio, resamples=RESAMPLES),
    "leave_one_out": functools.partial(leave_one_out, log_ratio),  # Student's
}


def coverage(
    method: Callable[[np.ndarray], Interval], seeds: int
) -> tuple[float, float]:
    """Share of studies whose interval holds the ratio, and its log's median width."""
    rng = np.random.default_rng(seeds)
    ends = np.array([method(synthetic_study(seeds, rng))[1:] for _ in range(STUDIES)])
    held = (ends[:, 0] <= np.log(RATIO)) & (np.log(RATIO) <= ends[:, 1])
    return float(held.mean()), float(np.median(np.diff(ends)))


def mean_curves_interval(study: np.ndarray) -> tuple[float, float]:
    """The interval of `savings` at 5 min, of losses (S, 2, M), SIDM first."""
    seeds = np.arange(len(study))
    sidm, other = (Losses(MINUTES, study[:, side], seeds) for side in (0, 1))
    return savings_between(sidm, other)[SIZE][4:6]


def seedwise_interval(study: np.ndarray) -> tuple[float, float]:
    """The interval of `data_ratio` at 5 min, of losses (S, 2, M), SIDM first."""
    sidm, alone = study[:, 0, SIZE], study[:, 1]
    return data_ratio(MINUTES.tolist(), alone, sidm, MINUTES[SIZE])[1:3]


#: the estimator on studies of `released_study`
AS_RELEASED = "data ratio by seed, as noisy as released"
#: Estimator -> its interval from losses (S, 2, M), and its true value from the data
#: ratio: the data ratio itself, or the ratio of losses at 5 min.
ESTIMATORS: dict[
    str, tuple[Callable[[np.ndarray], Sequence[float]], Callable[[float], float]]
] = {
    "data ratio of mean curves": (mean_curves_interval, float),
    "data ratio by seed": (seedwise_interval, float),
    AS_RELEASED: (seedwise_interval, float),
    "ratio of mean losses": (
        lambda study: ratio_of_means(study[:, ::-1, SIZE])[1:],
        lambda ratio: ratio**-SLOPE,
    ),
    "mean ratio of losses": (
        lambda study: mean_ratio(study[:, :1, SIZE], study[:, 1:, SIZE])[1:],
        lambda ratio: ratio**-SLOPE,
    ),
}


def estimator_coverage(
    name: str, ratio: float, seeds: int
) -> tuple[float, float, float]:
    """Shares of intervals of an estimator that hold the true value or lie above it.

    The third value is the share of studies without an interval. `name` is a key of
    ESTIMATORS, `ratio` the true data ratio of the studies.
    """
    ends_of, truth_of = ESTIMATORS[name]
    rng, truth = np.random.default_rng([seeds, round(10 * ratio)]), truth_of(ratio)
    make = functools.partial(synthetic_study, noise=FIGURE3_NOISE)
    made = released_study if name == AS_RELEASED else make
    studies = (made(seeds, rng, ratio) for _ in range(STUDIES))
    ends = np.array([ends_of(study) for study in studies])
    known = ends[np.isfinite(ends).all(1)]
    held = (known[:, 0] <= truth) & (truth <= known[:, 1])
    above = known[:, 0] > truth
    return float(held.mean()), float(above.mean()), 1 - len(known) / STUDIES


def make(study: Any, workers: int, data: Path, results: Path) -> dict[str, Any]:
    """Measure the coverage of the kinds of interval and of the estimators.

    By kind of interval and number of seeds: coverage and width. By 'estimators': rows
    of estimator, data ratio, number of seeds, and the shares of `estimator_coverage`.
    """
    by_kind: dict[str, Any] = {
        name: {str(n): [round(x, 4) for x in coverage(method, n)] for n in SEEDS}
        for name, method in METHODS.items()
    }
    rows = [
        [name, ratio, n, *(round(x, 4) for x in estimator_coverage(name, ratio, n))]
        for name in ESTIMATORS
        for ratio in TRUTHS
        for n in ESTIMATED_SEEDS
    ]
    return by_kind | {"estimators": rows}


def estimators(file: Path = FILE) -> pd.DataFrame:
    """Stored coverage of the estimators, a row per estimator, data ratio and seeds.

    `ratio` is the data ratio of the synthetic studies; `share`, the share of intervals
    that hold the true value; `above`, the share that lies above it; `open`, the share
    of studies without an interval.
    """
    names = ["estimator", "ratio", "seeds", "share", "above", "open"]
    return pd.DataFrame(read_record(file)["estimators"], columns=names)


def page_table() -> pd.DataFrame:
    """The coverage of the kinds of interval, a row per number of seeds."""
    names = {
        "leave_one_out": "Student's, one seed left out",
        "percentile": "percentiles of resampled seeds",
    }
    stored = read_record(FILE)
    shares = pd.DataFrame(
        {
            words: {int(n): f"{share:.0%}" for n, (share, _) in stored[name].items()}
            for name, words in names.items()
        }
    )
    return shares.rename_axis("seeds").reset_index()


def estimators_page_table() -> pd.DataFrame:
    """The shares of `estimators` with the headings of a page; in brackets the open."""
    rows = estimators()
    without = rows.open.map(" ({:.0%})".format).where(rows.open > 0, "")
    shown = rows.assign(text=rows.share.map("{:.0%}".format) + without)
    shown = shown.pivot(index=["estimator", "ratio"], columns="seeds", values="text")
    shown = shown.rename(columns="{} seeds".format)
    return shown.rename_axis(index={"ratio": "true data ratio"}).reset_index()
