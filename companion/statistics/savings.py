"""Data efficiency: how many times as much data one method needs for another's loss.

Losses are read from isotonic fits of the learning curves: of mean curves by `savings`,
of each seed's curve by `data_ratio`.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from companion.methods import COMPARED
from companion.statistics.intervals import FEWEST_SEEDS, interval
from companion.statistics.pairs import (
    Losses,
    complete,
    interval_texts,
    paired_comparison,
    unique_results,
)
from ownrobot.comparison.statistics import Interval, mean_interval, significant

NUMBERS = ["novice_minutes", "seeds", "loss", "ratio", "low", "high"]
COLUMNS = ["system", "method", *NUMBERS, "bound"]
ALONE = COMPARED[1]  # training without SIDM
NO_VALUE = "no value"  # of a ratio from too few seeds


def isotonic_fit(losses: np.ndarray) -> np.ndarray:
    """The nearest curve (M,) that never rises, fitted to the logarithm of losses (M,).

    The losses are in order of growing data.
    """
    from scipy.optimize import isotonic_regression

    logs = np.log(np.asarray(losses, float))
    return np.exp(isotonic_regression(logs, increasing=False).x)


def minutes_needed(
    minutes: np.ndarray, curve: np.ndarray, loss: float
) -> tuple[float, str]:
    """Novice data with which a falling curve (M,) of M rising sizes reaches a loss.

    The minutes are interpolated between logarithms, and come with how to read them:
    '='; '<=' if the smallest size is enough; '>' if the largest is not.
    """
    if curve[0] <= loss:
        return float(minutes[0]), "=" if curve[0] == loss else "<="
    if curve[-1] > loss:
        return float(minutes[-1]), ">"
    right = int(np.argmax(curve <= loss))
    across = np.log(curve[right - 1] / loss) / np.log(curve[right - 1] / curve[right])
    log_left, log_right = np.log(minutes[right - 1]), np.log(minutes[right])
    return float(np.exp(log_left + across * (log_right - log_left))), "="


class DataRatio(NamedTuple):
    """A data ratio over seeds, with its 95 % interval, or what seeds bound it by.

    Attributes:
        value: the geometric mean; NaN with a seed's bound
        low: end of the interval; the bound where all seeds are above it, else NaN
        high: likewise; infinity and 0 stand opposite to a bound
        bound: in words, where there is no value: 'at least 24 in 2 of 5 seeds, 0.2 to
            0.98 in 3'
    """

    value: float
    low: float
    high: float
    bound: str = NO_VALUE

    def text(self, digits: int = 3) -> str:
        """The value with its interval, or the bound."""
        known = Interval(self.value, self.low, self.high)
        return self.bound if np.isnan(self.value) else known.text(digits)


def data_ratio(
    sizes: Sequence[float], alone: np.ndarray, losses: np.ndarray, at: float
) -> DataRatio:
    """Data of training alone divided by the method's, at equal loss, paired by seed.

    The size is chosen before the results are known. The estimate over seeds is the
    geometric mean, with Student's interval of the logarithm. Where the curve of a seed
    does not reach the loss, that seed's ratio is a bound. Then there is neither a mean
    nor an interval: a true ratio far beyond its bound would raise the one and widen the
    other. What is known is told seed by seed.

    Training alone has losses (S, M) at M rising `sizes`, min; the method has `losses`
    (S,) with `at` minutes.
    """
    needed = [
        minutes_needed(np.asarray(sizes), isotonic_fit(curve), loss)
        for curve, loss in zip(alone, losses, strict=True)
    ]
    if len(needed) < FEWEST_SEEDS:
        return DataRatio(np.nan, np.nan, np.nan)
    ratios = np.array([minutes / at for minutes, _ in needed])
    signs = np.array([sign for _, sign in needed])
    beyond, below = signs == ">", signs == "<="
    if not (beyond | below).any():
        value, low, high = np.exp(mean_interval(np.log(ratios))).tolist()
        return DataRatio(value, low, high, "")
    low = float(ratios.min()) if beyond.all() else 0.0 if below.all() else np.nan
    high = np.inf if beyond.all() else float(ratios.max()) if below.all() else np.nan
    return DataRatio(np.nan, low, high, _in_words(ratios, beyond, below))


def _in_words(ratios: np.ndarray, beyond: np.ndarray, below: np.ndarray) -> str:
    """What seeds say of a ratio that some of them only bound."""
    known, parts = ratios[~beyond & ~below], []
    if beyond.any():
        parts.append((f"at least {significant(ratios[beyond].min(), 2)}", beyond.sum()))
    if below.any():
        parts.append((f"at most {significant(ratios[below].max(), 2)}", below.sum()))
    if len(known):
        ends = [significant(end, 2) for end in (known.min(), known.max())]
        parts.append((" to ".join(dict.fromkeys(ends)), len(known)))
    if len(parts) == 1:
        return parts[0][0]
    (first, number), *others = parts
    words = [f"{first} in {number} of {len(ratios)} seeds"]
    return ", ".join(words + [f"{text} in {number}" for text, number in others])


def savings(
    frame: pd.DataFrame,
    methods: Sequence[str] = ("sidm",),
    value: str = "validation_loss",
    held_out: float = 0.0,
) -> pd.DataFrame:
    """Novice data of training without SIDM divided by the method's, at equal loss.

    Seeds that lack one of a method's sizes are left out; `held_out` is as in
    `intervals.interval`.

    Returns:
        One row per system, method and size. `loss` is the method's, from its isotonic
        fit; `ratio`, the data of training alone for this loss by the data of the
        method; `low` and `high`, the ends of its 95 % interval, NaN if the ratio
        without one of the seeds is a bound; `bound`, how to read the ratio: '=', '>='
        or '<='.
    """
    rows: list[tuple] = []
    for system in dict.fromkeys(frame.system):
        for method in methods:
            own, alone = (
                complete(unique_results(frame, system, [name]), value)
                for name in (method, ALONE)
            )
            found = savings_between(own, alone, held_out)
            rows += [(system, method, *row) for row in found]
    return pd.DataFrame(rows, columns=COLUMNS).astype(dict.fromkeys(NUMBERS, float))


def savings_between(own: Losses, other: Losses, held_out: float = 0.0) -> list[tuple]:
    """Data ratio between two methods.

    A tuple per size of `own`: minutes, number of seeds, loss, ratio, low, high, bound.
    The divisor is the size itself, also where the fit is level and a smaller size would
    be enough. An interval needs values: a bound has none.
    """
    seeds, count = np.intersect1d(own.seeds, other.seeds), len(own.minutes)
    if not (seeds.size and count and len(other.minutes)):
        return []
    # (S, M + N)
    both = np.hstack([side.values[np.isin(side.seeds, seeds)] for side in (own, other)])

    def at_size(losses: np.ndarray, size: int) -> tuple[float, float, str]:
        mean = losses.mean(0)
        loss, curve = isotonic_fit(mean[:count])[size], isotonic_fit(mean[count:])
        data, sign = minutes_needed(other.minutes, curve, loss)
        return float(loss), float(data / own.minutes[size]), sign

    def log_ratio(losses: np.ndarray, size: int) -> float:
        _, ratio, sign = at_size(losses, size)
        return float(np.log(ratio)) if sign == "=" else np.nan

    rows: list[tuple] = []
    for size, minutes in enumerate(own.minutes):
        estimate = interval(functools.partial(log_ratio, size=size), both, held_out)
        loss, ratio, sign = at_size(both, size)
        bound = {"=": "=", ">": ">=", "<=": "<="}[sign]
        ends = np.exp(estimate[1:]).tolist()
        rows.append((float(minutes), len(seeds), loss, ratio, *ends, bound))
    return rows


def with_savings(
    means: pd.DataFrame,
    frame: pd.DataFrame,
    reference: pd.DataFrame,
    on: Sequence[str],
    by: Sequence[str],
) -> pd.DataFrame:
    """Add loss ratios and data savings beside a reference to a table of means.

    `means` has one row per group (columns `on`, the system first, and `by`) and size,
    `frame` the groups' results with `loss`. Added are `ratio`, `low` and `high` of
    `pairs.paired_comparison`, and `saved`, `saved_low`, `saved_high` and `bound`: the
    reference's data divided by the group's, at equal loss. NaN in rows without a
    reference.
    """
    point = [*on, *by, "novice_minutes"]
    ratios = paired_comparison(
        frame, reference, on=[*on, "novice_minutes"], by=by, value="loss"
    )
    rows: list[tuple] = []
    for key, group in frame.groupby(point[:-1], sort=False):
        other = reference[(reference[list(on)] == list(key[: len(on)])).all(axis=1)]
        own, others = (complete(side, "loss") for side in (group, other))
        for minutes, _, _, *ends in savings_between(own, others):
            rows.append((*key, minutes, *ends))
    saved = pd.DataFrame(
        rows, columns=[*point, "saved", "saved_low", "saved_high", "bound"]
    )
    ratios = ratios[[*point, "ratio", "low", "high"]]
    table = means.merge(ratios, how="left", on=point)
    return table.merge(saved.astype(means[point].dtypes), how="left", on=point)


def with_savings_texts(table: pd.DataFrame) -> pd.DataFrame:
    """Ratios and savings of a table of `with_savings` for a page, '-' without one."""
    names = {"saved": "ratio", "saved_low": "low", "saved_high": "high"}
    saved = table[["bound", *names]].rename(columns=names).fillna({"bound": "="})
    texts = {
        "ratio (95 % interval)": interval_texts(table[["ratio", "low", "high"]]),
        "times the data": ratio_texts(saved),
    }
    return pd.DataFrame(texts, index=table.index, dtype=object).replace("nan", "-")


def ratio_texts(table: pd.DataFrame, digits: int = 2) -> list[str]:
    """The ratios of a table of `savings` for a page: 'at least 3.2 (1.9 to 5.4)'.

    A ratio without an interval has no brackets.
    """
    prefix = {"=": "", ">=": "at least ", "<=": "at most "}
    columns = table[["bound", "ratio", "low", "high"]]
    return [
        f"{prefix[bound]}{Interval(*ends).text(digits)}"
        for bound, *ends in columns.itertuples(index=False)
    ]


def minutes_text(minutes: np.ndarray, losses: np.ndarray, loss: float) -> str:
    """The data with which a curve (M,) reaches a loss, as text: 'more than 20 min'."""
    data, sign = minutes_needed(minutes, isotonic_fit(losses), loss)
    prefix = {"=": "", "<=": "at most ", ">": "more than "}[sign]
    return f"{prefix}{float(f'{data:.2g}'):g} min"
