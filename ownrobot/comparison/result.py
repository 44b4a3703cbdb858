"""The result of a comparison: tables, the ratio of two methods, and the verdict."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from ownrobot.comparison.plan import DEFAULT_METHODS, TRIVIAL, Fit, Plan
from ownrobot.comparison.statistics import Interval, resampled_loss, resampled_ratio
from ownrobot.fitting.errors import OPEN_LOOP, score_of
from ownrobot.fitting.splits import groups_of
from sidm.drives import Drive

AHEAD = 1.0  # s, of the open-loop errors in the table
MORE = 1.05  # ratio of the losses with less and with all data that is worth recording


class FitResult(NamedTuple):
    """The evaluation of one fit on the drives held out."""

    fit: Fit
    minutes: float  # of motion that it learnt from
    seconds: float  # what the fit took
    losses: pd.DataFrame  # the table of `Model.losses` on the drives held out
    errors: pd.DataFrame  # the table of `Model.evaluate` on these drives
    path: np.ndarray  # (K + 1, S), states predicted from the start of the worst drive

    @property
    def worst(self) -> pd.Series:
        """The row of the drive held out with the largest loss."""
        return self.losses.loc[self.losses.loss.idxmax()]


class Verdict(NamedTuple):
    """What a comparison says."""

    method: str  # the method to take
    others: tuple[str, ...]  # methods that are not surely worse than the best
    sentence: str  # the answer, for people


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """Methods compared on the same drives; `ownrobot.compare` returns it."""

    plan: Plan  # what was fitted
    results: Sequence[FitResult]  # the evaluations of all fits
    notes: tuple[str, ...]  # of the drives, and faults of fits, a line each
    drives: Sequence[Drive]  # of the robot

    def __repr__(self) -> str:
        return f"{self.text()}\n{self.verdict.sentence}"

    def of(self, method: str, share: float = 1.0) -> list[FitResult]:
        """The evaluations of a method, by repeat and fold."""
        chosen = [
            result
            for result in self.results
            if (result.fit.method, result.fit.share) == (method, share)
        ]
        return sorted(chosen, key=lambda result: result.fit)

    def losses(self, method: str, share: float = 1.0) -> np.ndarray:
        """Losses (n,) of the fits of a method, by repeat and fold."""
        of_drives = [result.losses for result in self.of(method, share)]
        return np.array([score_of(losses).loss for losses in of_drives])

    def is_complete(self, method: str, share: float = 1.0) -> bool:
        """Whether all fits of a method with a share of the data succeeded."""
        return len(self.of(method, share)) == self.plan.folds * self.plan.repeats

    @cached_property
    def methods(self) -> list[str]:
        """The methods with all fits on all data, the lowest loss first."""
        complete = [m for m in self.plan.methods if self.is_complete(m)]
        return sorted(complete, key=lambda method: self.losses(method).mean())

    def ratio(self, method: str, other: str) -> Interval:
        """Loss of a method divided by that of another, over paired fits."""
        return resampled_ratio(self.losses(method), self.losses(other), self.plan.folds)

    @cached_property
    def table(self) -> pd.DataFrame:
        """A row for each method, the lowest loss first.

        Columns: `method`; `loss`, mean loss of a step, with `low` and `high`, its 95 %
        interval; `ratio`, the loss divided by that of the first row, with `ratio_low`
        and `ratio_high`; `spread`, standard deviation of the loss over the repeats;
        `position` (m) and `heading` (rad), the errors after AHEAD seconds open loop,
        where there is a pose and this horizon; `seconds`, of a fit with its
        pretraining.
        """
        rows = []
        for method in self.methods:
            losses = self.losses(method)
            loss = resampled_loss(losses, self.plan.folds)
            ratio = self.ratio(method, self.methods[0])
            row: dict[str, Any] = {"method": method, "loss": loss.value}
            row |= {"low": loss.low, "high": loss.high, "ratio": ratio.value}
            row |= {"ratio_low": ratio.low, "ratio_high": ratio.high}
            by_repeat = losses.reshape(self.plan.repeats, -1).mean(1)
            row["spread"] = by_repeat.std(ddof=1) if len(by_repeat) > 1 else np.nan
            errors = self.errors(method)
            ahead = errors[errors.prediction == OPEN_LOOP]
            for name in ("position", "heading"):
                chosen = ahead[ahead.quantity == name]
                half_a_step = 0.5 / self.drives[0].body.rate
                at = chosen[(chosen.horizon - AHEAD).abs() <= half_a_step]
                if len(at):
                    row[name] = at.rmse.iloc[0]
            row["seconds"] = np.median([result.seconds for result in self.of(method)])
            rows.append(row)
        return pd.DataFrame(rows)

    @cached_property
    def curve(self) -> pd.DataFrame:
        """The learning curve of each method, a row for each share of the data.

        Columns: `method`, `share`, `minutes`, `loss`.
        """
        rows = []
        for method, share in itertools.product(self.methods, self.plan.shares):
            if self.is_complete(method, share):
                minutes = np.mean([result.minutes for result in self.of(method, share)])
                rows.append((method, share, minutes, self.losses(method, share).mean()))
        return pd.DataFrame(rows, columns=["method", "share", "minutes", "loss"])

    def errors(self, method: str) -> pd.DataFrame:
        """Errors by component and horizon, as `Model.evaluate` returns them.

        They are root mean squares over all fits on all data; horizons that not all
        folds have are left out, and so are medians.
        """
        tables = [result.errors for result in self.of(method)]
        keys = ["prediction", "quantity", "horizon", "unit"]
        numbers = ["rmse", "nothing_changes", "mean"]
        squares = pd.concat(tables)[keys + numbers]
        squares[numbers] = squares[numbers] ** 2
        groups = squares.groupby(keys, sort=False)
        means = groups[numbers].mean() ** 0.5
        return means[groups.size() == len(tables)].reset_index()

    def drive_losses(self, method: str) -> pd.DataFrame:
        """Mean loss of each drive over the repeats, the worst first.

        Columns: `drive`, `loss`.
        """
        joined = pd.concat([result.losses for result in self.of(method)])
        means = joined.groupby("drive", as_index=False).loss.mean()
        return means.sort_values("loss", ascending=False, ignore_index=True)

    def report(self, path: str | Path) -> None:
        """Write a report as one HTML page that needs no other file."""
        from ownrobot.comparison.report import write_report  # which imports this module

        write_report(self, Path(path))

    def intervals(self) -> pd.DataFrame:
        """Methods, their losses and their ratios to the first, as text."""
        shown = pd.DataFrame({"method": self.table.method})
        for title, names in (
            ("loss [95 %]", ["loss", "low", "high"]),
            ("ratio to the first [95 %]", ["ratio", "ratio_low", "ratio_high"]),
        ):
            rows = self.table[names].itertuples(index=False)
            shown[title] = [Interval(*row).text(3) for row in rows]
        return shown

    def text(self) -> str:
        """The table for a terminal."""
        shown = self.intervals()
        for name in ("spread", "position", "heading", "seconds"):
            if name in self.table:
                shown[name] = [f"{value:.2g}" for value in self.table[name]]
        shown = shown[[c for c in shown if not (shown[c] == "nan").all()]]
        titles_of_errors = {
            "spread": "over repeats",
            "position": f"position after {AHEAD:g} s [m]",
            "heading": f"heading after {AHEAD:g} s [rad]",
        }
        return shown.rename(columns=titles_of_errors).to_string(index=False)

    @cached_property
    def verdict(self) -> Verdict:
        """Which method to take, by how much, and whether more data would help."""
        best = self.methods[0]
        # The first row is the best by chance too: whoever may equal it is named.
        near = [m for m in self.methods[1:] if not self.ratio(m, best).low > 1]
        if near and np.isnan(self.ratio(near[0], best).low):
            once = self.plan.folds == len(np.unique(groups_of(self.drives)))
            more = "record more sessions" if once else "take more folds or repeats"
            sentence = (
                f"{best} has the lowest loss, but {len(self.losses(best))} fits are "
                f"too few to compare methods: {more}"
            )
            return Verdict(best, tuple(near), f"{sentence}; {self._more_data(best)}.")
        trivial = next((m for m in self.methods if m in TRIVIAL), "")
        sure = [
            method
            for method in (best, *near)
            if not trivial or self.ratio(method, trivial).high < 1
        ]
        if not sure:
            sentence = f"No method is surely better than '{trivial}'."
            return Verdict(trivial, tuple(near), sentence)
        order = {name: place for place, name in enumerate(DEFAULT_METHODS)}
        method = min(sure, key=lambda name: order.get(name, len(order)))
        sentence = f"{self._choice(method, near, trivial)}; {self._more_data(method)}."
        return Verdict(method, tuple(near), sentence)

    def _choice(self, method: str, near: Sequence[str], trivial: str) -> str:
        """Which method, and by how much."""
        best, others = self.methods[0], [trivial] if trivial else []
        if method != best:
            others.append(best)
        elif not near:
            others += self.methods[1:2]
        words = [
            f"{self.ratio(method, other)} times that of {other}"
            for other in dict.fromkeys(others)
        ]
        loss = resampled_loss(self.losses(method), self.plan.folds)
        why = ""
        if near:
            alike = ", ".join(m for m in (best, *near) if m != method)
            why = f", the simplest of those not surely apart (beside {alike})"
        return f"Take {method}{why}: its loss is {' and '.join(words) or loss}"

    def _more_data(self, method: str) -> str:
        """Whether more data would help a method."""
        smaller = [s for s in self.plan.shares[:-1] if self.is_complete(method, s)]
        if not smaller:
            return "whether more data would help was not measured"
        less, full = self.losses(method, smaller[-1]), self.losses(method)
        ratio = resampled_ratio(less, full, self.plan.folds)
        said = f"with {smaller[-1]:.0%} of the data its loss is {ratio} times as large"
        if ratio.low > 1 and ratio.value >= MORE:
            return f"more data would help, since {said}"
        if ratio.high < MORE:
            return f"more data would hardly help, since {said}"
        return f"whether more data would help is not sure: {said}"
