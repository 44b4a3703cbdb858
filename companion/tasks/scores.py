"""Scores of the benchmark: one row for each method, and who is apart from whom.

A method's score on a task is its loss divided by that of least squares on the novice
alone, with the same drives; over tasks it is the geometric mean. Intervals and tests
are about other drives of the same robots: what varies is which drives a seed draws. A
pair of robots and a seed give one value, the mean over their sizes, which share drives.
Each pair has a variance of its own (Satterthwaite, Biometrics 2, 1946). Seeds only
divide the drives of real robots anew, which adds to the variance (Nadeau and
Bengio, Machine Learning 52, 2003).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from companion.statistics.intervals import holm
from companion.tasks.catalogue import HELD_OUT, RECORDED_PAIRS, SEEDS
from companion.tasks.trial import NO_FAILURE, EntryResult
from ownrobot.comparison.statistics import CONFIDENCE, Interval

REFERENCE = "least_squares"  # whose loss is 1
ALONE = "novice_only"  # whose data ratio at RATIO_MINUTES is 1
RATIO_MINUTES = 5.0
RECORDED = {f"{expert} to {novice}" for novice, expert in RECORDED_PAIRS}
#: Variance that dividing the same drives anew adds, in variances of one seed's value.
DIVIDED_ANEW = HELD_OUT / (1 - HELD_OUT)
INDEX = "robots", "task", "seed"
#: What is measured: fields of an `EntryResult`, two words and numbers.
MEASURED = "status", "message", "loss", "position", "heading", "seconds", "memory"
#: The logarithms of a method without trials beside the reference's.
NONE = pd.Series(
    dtype=float, index=pd.MultiIndex.from_arrays(3 * [[]], names=list(INDEX))
)


class Mean(NamedTuple):
    """A mean of logarithms.

    Attributes:
        value: the mean; NaN without values
        error: its standard error; NaN if a pair of robots has one seed alone
        freedom: degrees of freedom of the error
    """

    value: float
    error: float
    freedom: float

    @property
    def interval(self) -> Interval:
        """The geometric mean with its 95 % interval."""
        from scipy import stats  # here, since it takes long to import

        reach = stats.t.ppf((1 + CONFIDENCE) / 2, self.freedom) * self.error
        ends = (self.value + d for d in (0.0, -reach, reach))
        return Interval(*(float(np.exp(end)) for end in ends))

    @property
    def p(self) -> float:
        """Two-sided p-value of Student's test that the mean is 0."""
        from scipy import stats

        return float(2 * stats.t.sf(abs(self.value) / self.error, self.freedom))


def mean_of(logs: pd.Series) -> Mean:
    """The mean over tasks, and how certain it is.

    Args:
        logs: logarithms by robots, task and seed, which are levels of the index; NaN
            are left out. Of a pair of robots, seeds that lack one of its tasks are not
            used.
    """
    means, variances, sizes, counts = [], [], [], []
    for robots, own in logs.dropna().groupby("robots"):
        tasks = own.unstack("task").dropna()
        by_seed, count = tasks.to_numpy().mean(1), len(tasks)
        means.append(by_seed.mean() if count else np.nan)
        spread = by_seed.var(ddof=1) if count > 1 else np.nan
        shared = DIVIDED_ANEW if robots in RECORDED else 0.0
        variances.append(spread * (1 / max(count, 1) + shared))
        sizes.append(tasks.shape[1])
        counts.append(count)
    if not means:
        return Mean(np.nan, np.nan, np.nan)
    weights, free = np.array(sizes) / sum(sizes), np.array(counts) - 1
    parts = weights**2 * np.array(variances)
    squares = (parts**2 / np.maximum(free, 1)).sum()
    freedom = parts.sum() ** 2 / squares if squares > 0 else float(free.sum())
    return Mean(float(weights @ np.array(means)), float(parts.sum() ** 0.5), freedom)


def results_frame(results: Iterable[EntryResult]) -> pd.DataFrame:
    """A row for each trial, with `method`, `task`, `seed` and the measured values."""
    rows = []
    for result in results:
        about, task = result.about, result.about.task
        row = {
            "method": about.method + (f" ({about.code})" if about.code else ""),
            "task": task.name,
            "seed": about.seed,
            "robots": task.name.rpartition(", ")[0],
            "minutes": task.minutes,
        }
        rows.append(row | {name: getattr(result, name) for name in MEASURED})
    columns = ["method", "task", "seed", "robots", "minutes", *MEASURED]
    frame = pd.DataFrame(rows, columns=columns)
    return frame.astype(dict.fromkeys(MEASURED[2:], float))


def log_ratios(frame: pd.DataFrame, value: str = "loss") -> pd.DataFrame:
    """Log ratio to the reference, with a row for each task and seed, by method.

    A method has no value on a task where one of its trials failed, or where it lacks
    one of the first SEEDS seeds that the reference has.
    """
    table = frame.pivot_table(index=[*INDEX], columns="method", values=value)
    if REFERENCE not in table:
        return pd.DataFrame(index=NONE.index)
    table = table[table[REFERENCE].notna()]
    logs = np.log(table).sub(np.log(table[REFERENCE]), axis=0)
    counts = logs.groupby("task").count()
    enough = counts.ge(counts[REFERENCE].clip(upper=SEEDS), axis=0)
    tried = frame[frame.status != "ok"].groupby(["task", "method"]).size()
    for task, method in tried.index:
        if method in enough and task in enough.index:
            enough.loc[task, method] = False
    return logs.where(enough.reindex(logs.index.get_level_values("task")).to_numpy())


def task_scores(frame: pd.DataFrame, value: str = "loss") -> pd.DataFrame:
    """Mean over seeds of the log ratio to the reference, tasks by methods."""
    logs = log_ratios(frame, value)
    return logs.groupby("task").mean() if len(logs) else logs


def mean_ratio(
    frame: pd.DataFrame, method: str, tasks: Iterable[str], value: str = "loss"
) -> Interval:
    """A method's loss or error divided by the reference's; NaN without results.

    It is the geometric mean over tasks, with its interval.
    """
    logs = log_ratios(frame[frame.task.isin([*tasks])], value)
    return mean_of(logs.reindex(columns=[method])[method]).interval


def score_table(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each method: the best first, those with fewer tasks last.

    Columns: `method`; `score` with `low` and `high`, the loss divided by that of least
    squares on the novice alone; `position` and `heading`, the same ratio of the errors
    after 1 s open loop; `data_ratio`, see `data_ratio`, with `data_bound`; `seconds` of
    a fit, median; `tasks` with a score; `failures`, of trials.
    """
    logs = log_ratios(frame)
    ahead = {name: task_scores(frame, name) for name in ("position", "heading")}
    rows = []
    for method, trials in frame.groupby("method"):
        own = logs[method] if method in logs else NONE
        score, low, high = mean_of(own).interval
        row = {"method": method, "score": score, "low": low, "high": high}
        for name, table in ahead.items():
            if method in table:
                row[name] = float(np.exp(table[method].mean()))
        known = data_ratio(frame, str(method)) if own.notna().any() else (np.nan, "")
        row["data_ratio"], row["data_bound"] = known
        row["seconds"] = trials.seconds.median()
        row["tasks"] = len(own.dropna().groupby("task"))
        row["failures"] = int((~trials.status.isin(NO_FAILURE)).sum())
        rows.append(row)
    table = pd.DataFrame(rows)
    fewer = table.tasks < table.tasks.max()
    order = table.assign(fewer=fewer).sort_values(["fewer", "score"]).index
    return table.loc[order].reset_index(drop=True)


def scores_by_group(
    frame: pd.DataFrame, groups: Mapping[str, Iterable[str]]
) -> pd.DataFrame:
    """Scores over groups of tasks: a row for each method, a column for each group.

    They are intervals; None for a method without a score on one of the group's tasks.
    The best method of the first group is first, one without a score there last.
    """
    columns = {}
    for name, tasks in groups.items():
        logs = log_ratios(frame[frame.task.isin([*tasks])])
        means = logs.groupby("task").mean() if len(logs) else logs
        columns[name] = {
            method: mean_of(logs[method]).interval
            for method in means
            if means[method].notna().all()
        }
    first = next(iter(columns.values()), {})
    methods = sorted(
        set().union(*columns.values()),
        key=lambda name: (first[name].value if name in first else np.inf, name),
    )
    rows = [[column.get(name) for column in columns.values()] for name in methods]
    return pd.DataFrame(rows, index=methods, columns=[*columns], dtype=object)


def data_ratio(frame: pd.DataFrame, method: str) -> tuple[float, str]:
    """How much more data training alone needs for a method's loss at RATIO_MINUTES.

    The loss of training alone is interpolated in the logarithms of minutes and loss.

    Returns:
        The geometric mean over robots, NaN where nothing is known; and '>' or '<' where
        it is a bound, since a loss lies beyond what training alone was measured at.
    """
    means = frame.groupby(["robots", "minutes", "method"]).loss.mean().unstack("method")
    if method not in means or ALONE not in means:
        return np.nan, ""
    logs, bounds = [], set()
    for robots in means.index.get_level_values("robots").unique():
        rows = means.loc[robots].sort_index()
        curve = rows[ALONE].dropna().cummin()  # more data never harms
        curve = curve[~curve.duplicated()]
        loss = rows[method].get(RATIO_MINUTES, np.nan)
        if np.isnan(loss) or np.isnan(rows[ALONE].get(RATIO_MINUTES, np.nan)):
            continue
        bounds |= {">"} if loss < curve.iloc[-1] else set()
        bounds |= {"<"} if loss > curve.iloc[0] else set()
        sizes = np.log(curve.index.to_numpy() / RATIO_MINUTES)
        logs.append(np.interp(-np.log(loss), -np.log(curve.to_numpy()), sizes))
    if not logs or len(bounds) > 1:
        return np.nan, ""
    return float(np.exp(np.mean(logs))), "".join(bounds)


def pairwise(frame: pd.DataFrame, methods: Sequence[str] = ()) -> pd.DataFrame:
    """Which methods are apart: a row for each pair, with `first` the better one.

    Columns: `first`, `second`; `ratio` of the losses, geometric mean over the tasks of
    both; `p`, of Student's test, paired by robots and seed; `p_holm`, corrected for all
    pairs (Holm, 1979); `apart`, whether `p_holm` is below 0.05.
    """
    logs = log_ratios(frame)
    chosen = [m for m in methods or logs.columns if m in logs]
    rows = []
    for one, other in itertools.combinations(chosen, 2):
        mean = mean_of(logs[one] - logs[other])
        if not mean.error > 0:
            continue
        first, second = (one, other) if mean.value <= 0 else (other, one)
        rows.append((first, second, float(np.exp(-abs(mean.value))), mean.p))
    table = pd.DataFrame(rows, columns=["first", "second", "ratio", "p"])
    table["p_holm"] = holm(table.p.to_numpy())
    return table.assign(apart=table.p_holm < 1 - CONFIDENCE)
