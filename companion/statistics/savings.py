"""How much novice data a method saves, at each of its sizes."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

from companion.statistics.efficiency import isotonic_fit, minutes_needed
from companion.statistics.intervals import interval
from companion.statistics.pairs import (
    Losses,
    complete,
    interval_texts,
    paired_comparison,
)
from ownrobot.comparison.statistics import Interval

NUMBERS = ["novice_minutes", "seeds", "loss", "ratio", "low", "high"]
COLUMNS = ["system", "method", "against", *NUMBERS, "bound"]


def savings(
    frame: pd.DataFrame,
    methods: Sequence[str] = ("sidm",),
    against: Sequence[str] = ("novice_only",),
    value: str = "validation_loss",
    held_out: float = 0.0,
) -> pd.DataFrame:
    """Novice data of each comparison divided by the method's, at equal loss.

    Seeds that lack one of a method's sizes are left out; `held_out` is as in
    `intervals.interval`.

    Returns:
        One row per system, method, comparison and size. `loss` is the method's, from
        its isotonic fit; `ratio`, the data of the comparison for this loss by the data
        of the method; `low` and `high`, the ends of its 95 % interval, NaN if the ratio
        without one of the seeds is a bound; `bound`, how to read the ratio: '=', '>='
        or '<='.
    """
    rows: list[tuple] = []
    for system in dict.fromkeys(frame.system):
        for method in methods:
            losses = complete(frame, system, [method], value)
            for name in against:
                other = complete(frame, system, [name], value)
                rows_found = savings_between(losses, other, held_out)
                rows += [(system, method, name, *row) for row in rows_found]
    return pd.DataFrame(rows, columns=COLUMNS).astype(dict.fromkeys(NUMBERS, float))


def savings_between(own: Losses, other: Losses, held_out: float = 0.0) -> list[tuple]:
    """Data ratio between two methods with one curve each (K = 1).

    A tuple per size of `own`: minutes, number of seeds, loss, ratio, low, high, bound.
    The divisor is the size itself, also where the fit is level and a smaller size would
    be enough. An interval needs values: a bound has none.
    """
    seeds, count = np.intersect1d(own.seeds, other.seeds), len(own.minutes)
    if not (seeds.size and count and len(other.minutes)):
        return []
    # (S, M + N)
    both = np.hstack(
        [side.values[np.isin(side.seeds, seeds), 0] for side in (own, other)]
    )

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
        own_losses, other_losses = (
            complete(side.assign(method="any"), str(key[0]), ["any"], "loss")
            for side in (group, other)
        )
        for minutes, _, _, *ends in savings_between(own_losses, other_losses):
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


def texts_at(
    table: pd.DataFrame,
    method: str,
    minutes: float,
    systems: Iterable[str],
    digits: int = 2,
    unit: str = "",
) -> list[str]:
    """The ratios of a method at one size, a text for each system; else 'not run'.

    `table` is made by `savings` against one method; `unit` is added to the ratios.
    """
    rows = table[(table.method == method) & (table.novice_minutes == minutes)]
    texts = dict(zip(rows.system, ratio_texts(rows, digits), strict=True))
    return [texts[name] + unit if name in texts else "not run" for name in systems]


def minutes_text(minutes: np.ndarray, losses: np.ndarray, loss: float) -> str:
    """The data with which a curve (M,) reaches a loss, as text: 'more than 20 min'."""
    data, sign = minutes_needed(minutes, isotonic_fit(losses), loss)
    prefix = {"=": "", "<=": "at most ", ">": "more than "}[sign]
    return f"{prefix}{float(f'{data:.2g}'):g} min"
