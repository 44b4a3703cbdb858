"""Figures of a comparison."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ownrobot.comparison.plan import TRIVIAL
from ownrobot.fitting.errors import OPEN_LOOP
from sidm.plots import finish, side_by_side, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ownrobot.comparison.result import Comparison

MOST_LINES = 6  # methods in one plot, the best first
MUTED, MEAN = "0.45", "the mean"


def _shown(comparison: Comparison) -> list[str]:
    """The best methods; those that learn nothing are left out where others are."""
    learnt = [method for method in comparison.methods if method not in TRIVIAL]
    return (learnt or comparison.methods)[:MOST_LINES]


@styled
def losses_figure(comparison: Comparison) -> Figure:
    """Loss of each method with its interval, and the learning curves of the best."""
    from matplotlib.ticker import LogLocator

    figure, (losses, curves) = side_by_side(2)
    table = comparison.table
    errors = [table.loss - table.low, table.high - table.loss]
    if table.low.notna().all():
        losses.errorbar(table.loss, table.method, xerr=errors, fmt="o")
    else:
        losses.plot(table.loss, table.method, "o")
    losses.invert_yaxis()
    losses.set(xlabel="loss on sessions held out", title="all data, 95 % intervals")
    if (table.loss > 0).all():
        losses.set_xscale("log")
        wide = table.loss.max() > 100 * table.loss.min()
        losses.xaxis.set_major_locator(
            LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0))
        )
    finish(losses, legend=False)
    losses.xaxis.set_major_formatter("{x:g}")
    curve = comparison.curve
    for method in _shown(comparison):
        rows = curve[curve.method == method]
        curves.plot(rows.minutes, rows.loss, label=method)
    curves.set(xscale="log", yscale="log")
    curves.set(xlabel="motion learnt from (min)", ylabel="loss", title="learning curve")
    finish(curves, minutes=np.round(curve.minutes.unique(), 2))
    return figure


@styled
def horizons_figure(comparison: Comparison) -> Figure:
    """Open-loop errors of the best methods against the time ahead."""
    errors = {method: comparison.errors(method) for method in _shown(comparison)}
    ahead = {m: table[table.prediction == OPEN_LOOP] for m, table in errors.items()}
    first = next(iter(ahead.values()))
    names = [n for n in ("position", "heading") if n in set(first.quantity)]
    names = names or list(first.quantity.unique())[:2]
    figure, panels = side_by_side(max(1, len(names)))
    for axes, name in zip(panels, names, strict=False):
        for method, table in ahead.items():
            rows = table[table.quantity == name]
            axes.plot(rows.horizon, rows.rmse, marker="", label=method)
        rows = first[first.quantity == name]
        axes.plot(rows.horizon, rows["mean"], ":", color=MUTED, marker="", label=MEAN)
        axes.set(xlabel="time ahead, open loop (s)", ylim=(0, None), title=name)
        axes.set_ylabel(f"{name} error ({rows.unit.iloc[0]})")
        finish(axes)
    return figure


@styled
def drives_figure(comparison: Comparison) -> Figure:
    """Losses of the drives, sorted, of the method to take and of the best others."""
    figure, (axes,) = side_by_side(1)
    chosen = dict.fromkeys([comparison.verdict.method, *comparison.methods[:3]])
    for method in chosen:
        losses = np.sort(comparison.drive_losses(method).loss)
        shares = (np.arange(len(losses)) + 0.5) / len(losses)
        axes.plot(losses, shares, marker="", label=method)
    axes.set(xscale="log", xlabel="loss of a drive", ylabel="share of drives below")
    finish(axes)
    return figure
