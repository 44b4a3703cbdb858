"""Scores of the benchmark: one row for each method, and who is apart from whom.

A method's score on a task is its loss divided by that of least squares on the novice
alone, with the same drives; over tasks it is the geometric mean. Tasks are the unit of
the intervals: a task's seeds are averaged first, since they share motion.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pandas as pd

from companion.tasks.trial import EntryResult
from sidm.comparison.statistics import CONFIDENCE, Interval

REFERENCE = "least_squares"  # whose loss is 1
ALONE = "novice_only"  # whose data ratio at RATIO_MINUTES is 1
RATIO_MINUTES = 5.0


def results_frame(results: Iterable[EntryResult]) -> pd.DataFrame:
    """A row for each trial, with `method`, `task`, `seed` and the measured values."""
    rows = []
    for result in results:
        about, task = result.about, result.about.task
        method = about.method + (f" ({about.code})" if about.code else "")
        row = {"method": method, "task": task.name, "seed": about.seed}
        row |= {"robots": task.name.rpartition(", ")[0], "minutes": task.minutes}
        for name in ("status", "message", "loss", "position", "heading"):
            row[name] = getattr(result, name)
        rows.append(row | {"seconds": result.seconds, "memory": result.memory})
    columns = ["method", "task", "seed", "robots", "minutes", "status", "message"]
    columns += ["loss", "position", "heading", "seconds", "memory"]
    frame = pd.DataFrame(rows, columns=columns)
    numbers = ["loss", "position", "heading", "seconds", "memory"]
    return frame.astype(dict.fromkeys(numbers, float))


def log_ratios(frame: pd.DataFrame, value: str = "loss") -> pd.DataFrame:
    """Log ratio to the reference, with a row for each task and seed, by method."""
    table = frame.pivot_table(
        index=["task", "seed"], columns="method", values=value, aggfunc="first"
    )
    if REFERENCE not in table:
        return pd.DataFrame()
    return np.log(table).sub(np.log(table[REFERENCE]), axis=0)


def task_scores(frame: pd.DataFrame, value: str = "loss") -> pd.DataFrame:
    """Mean over seeds of the log ratio to the reference, tasks by methods.

    A method has no score on a task where a seed failed or is missing.
    """
    logs = log_ratios(frame, value)
    if not len(logs):
        return logs
    reference = logs[REFERENCE].groupby("task").count()
    groups = logs.groupby("task")
    return groups.mean().where(groups.count().eq(reference, axis=0))


def score_table(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each method: the best first, those with fewer tasks last.

    Columns: `method`; `score` with `low` and `high`, the loss divided by that of least
    squares on the novice alone; `position` and `heading`, the same ratio of the errors
    after 1 s open loop; `data_ratio`, the minutes that training alone needs for the
    method's loss at RATIO_MINUTES, divided by these minutes; `seconds` of a fit,
    median; `tasks` with a score; `failures`, trials without errors.
    """
    scores = task_scores(frame)
    ahead = {name: task_scores(frame, name) for name in ("position", "heading")}
    rows = []
    for method, trials in frame.groupby("method"):
        row = {"method": method}
        values = scores[method].dropna() if method in scores else pd.Series(dtype=float)
        interval = geometric_interval(values.to_numpy())
        row |= {"score": interval.value, "low": interval.low, "high": interval.high}
        for name, table in ahead.items():
            if method in table:
                row[name] = float(np.exp(table[method].mean()))
        row["data_ratio"] = data_ratio(frame, str(method))
        row["seconds"] = trials.seconds.median()
        row["tasks"] = len(values)
        row["failures"] = int((trials.status != "ok").sum())
        rows.append(row)
    table = pd.DataFrame(rows)
    fewer = table.tasks < table.tasks.max()
    order = table.assign(fewer=fewer).sort_values(["fewer", "score"]).index
    return table.loc[order].reset_index(drop=True)


def scores_by_group(
    frame: pd.DataFrame, groups: Mapping[str, Iterable[str]]
) -> pd.DataFrame:
    """Scores over groups of tasks: a row for each method, a column for each group.

    The best method of the first group is first, one without a score there last. The
    interval of a group of one task is over its seeds.

    Args:
        frame: rows of trials, as `results_frame` returns them.
        groups: name of a group -> names of its tasks.

    Returns:
        Intervals; None for a method without a score on one of the group's tasks.
    """
    columns = {}
    for name, tasks in groups.items():
        trials = frame[frame.task.isin([*tasks])]
        scores = task_scores(trials)
        logs = log_ratios(trials) if len(scores) == 1 else scores
        columns[name] = {
            method: geometric_interval(logs[method].to_numpy())
            for method in scores
            if scores[method].notna().all()
        }
    first = next(iter(columns.values()), {})
    methods = sorted(
        set().union(*columns.values()),
        key=lambda name: (first[name].value if name in first else np.inf, name),
    )
    rows = [[column.get(name) for column in columns.values()] for name in methods]
    return pd.DataFrame(rows, index=methods, columns=[*columns], dtype=object)


def geometric_interval(logs: np.ndarray) -> Interval:
    """Geometric mean and its Student interval from logarithms (n,), independent."""
    from scipy import stats

    if not len(logs):
        return Interval(np.nan, np.nan, np.nan)
    mean = float(np.mean(logs))
    if len(logs) < 2:
        return Interval(float(np.exp(mean)), np.nan, np.nan)
    error = float(np.std(logs, ddof=1)) / np.sqrt(len(logs))
    width = float(stats.t.ppf((1 + CONFIDENCE) / 2, len(logs) - 1)) * error
    return Interval(*(float(np.exp(mean + d)) for d in (0.0, -width, width)))


def data_ratio(frame: pd.DataFrame, method: str) -> float:
    """How much more data training alone needs for a method's loss at RATIO_MINUTES.

    The loss of training alone is interpolated in the logarithms of minutes and loss.
    It is a geometric mean over robots where this loss lies within that curve; NaN where
    it does for none.
    """
    means = frame.groupby(["robots", "minutes", "method"]).loss.mean().unstack("method")
    if method not in means or ALONE not in means:
        return np.nan
    ratios = []
    for robots in means.index.get_level_values("robots").unique():
        rows = means.loc[robots].sort_index()
        curve = rows[ALONE].dropna()
        if RATIO_MINUTES not in rows.index or len(curve) < 2:
            continue
        loss = rows[method].get(RATIO_MINUTES, np.nan)
        losses = np.minimum.accumulate(curve.to_numpy())  # more data never harms
        if not losses[-1] <= loss <= losses[0]:
            continue
        minutes = np.interp(
            -np.log(loss), -np.log(losses), np.log(curve.index.to_numpy())
        )
        ratios.append(minutes - np.log(RATIO_MINUTES))
    return float(np.exp(np.mean(ratios))) if ratios else np.nan


def pairwise(frame: pd.DataFrame, methods: Sequence[str] = ()) -> pd.DataFrame:
    """Which methods are apart: a row for each pair, with `first` the better one.

    Columns: `first`, `second`; `ratio` of the losses, geometric mean over the tasks of
    both; `p`, of Student's paired test over tasks; `p_holm`, corrected for all pairs
    (Holm, 1979); `apart`, whether `p_holm` is below 0.05.
    """
    from scipy import stats

    scores = task_scores(frame)
    chosen = [m for m in methods or scores.columns if m in scores]
    rows = []
    for one, other in itertools.combinations(chosen, 2):
        differences = (scores[one] - scores[other]).dropna().to_numpy()
        if len(differences) < 2:
            continue
        mean = float(np.mean(differences))
        first, second = (one, other) if mean <= 0 else (other, one)
        p = float(stats.ttest_1samp(differences, 0.0).pvalue)
        rows.append((first, second, float(np.exp(-abs(mean))), p))
    table = pd.DataFrame(rows, columns=["first", "second", "ratio", "p"])
    table["p_holm"] = holm(table.p.to_numpy())
    return table.assign(apart=table.p_holm < 1 - CONFIDENCE)


def holm(p: np.ndarray) -> np.ndarray:
    """P-values (n,) corrected for n tests by Holm's step-down procedure."""
    order, count = np.argsort(p), len(p)
    factors = count - np.arange(count)
    corrected = np.empty(count)
    corrected[order] = np.minimum(1, np.maximum.accumulate(factors * p[order]))
    return corrected
