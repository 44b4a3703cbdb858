"""Figures of a comparison, and of the evaluation of one model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ownrobot.comparison.plan import TRIVIAL
from ownrobot.fitting.errors import ONE_STEP, OPEN_LOOP
from ownrobot.plots import WIDTH, finish, side_by_side, styled

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ownrobot.comparison.result import Comparison

MOST_LINES = 6  # methods in one plot, the best first
MUTED, NOTHING, MEAN = "0.45", "nothing changes", "the mean"
SMALLEST = 1e-12  # of an error that another one is divided by


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
    finish(curves, minutes=np.round(curve.minutes.unique(), 2), legend=False)
    figure.legend(loc="outside lower center", ncols=3)
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
        tables = {m: table[table.quantity == name] for m, table in ahead.items()}
        axes.set(xlabel="time ahead, open loop (s)", title=name)
        _open_loop_panel(axes, tables)
    return figure


def _open_loop_panel(
    axes: Axes, tables: Mapping[str, pd.DataFrame], still: bool = False
) -> None:
    """Errors of one quantity of models, by their names, against the time ahead.

    With `still`, those of predicting no change are there, too.
    """
    for label, rows in tables.items():
        axes.plot(rows.horizon, rows.rmse, marker="", label=label)
    rows = next(iter(tables.values()))
    if still:
        axes.plot(rows.horizon, rows.nothing_changes, "--", color=MUTED, label=NOTHING)
    axes.plot(rows.horizon, rows["mean"], ":", color=MUTED, label=MEAN)
    ylabel = f"{rows.quantity.iloc[0]} error ({rows.unit.iloc[0]})"
    axes.set(ylabel=ylabel, ylim=(0, None))
    finish(axes)


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


@styled
def errors_figure(table: pd.DataFrame) -> Figure:
    """Figure of a table of errors from `Model.evaluate`, one step ahead and open loop.

    The first panel has a bar for each component of y: the error one step ahead, divided
    by the error of predicting the mean, beside the error of predicting no change. For a
    body with a pose, two more panels have the errors of position (m) and heading (rad)
    against the time ahead.
    """
    components = table[table.prediction == ONE_STEP]
    ahead = table[table.prediction == OPEN_LOOP]
    open_loop = ahead[ahead.quantity.isin(("position", "heading"))]
    figure, panels = side_by_side(3 if len(open_loop) else 1)
    if len(open_loop):
        figure.set_figwidth(2 * WIDTH)  # a file of its own, wider than a page
    mean = components["mean"].clip(lower=SMALLEST)
    names = components.quantity
    panels[0].barh(names, components.rmse / mean, label="model")
    still = components.nothing_changes / mean
    panels[0].plot(still, names, "|", color=MUTED, ms=12, mew=2, label=NOTHING)
    panels[0].axvline(1, color=MUTED, ls=":", label=MEAN)
    panels[0].invert_yaxis()
    panels[0].set(xlabel="error / error of predicting the mean", title="one step")
    finish(panels[0])
    errors = open_loop.groupby("quantity", sort=False)
    for axes, (name, rows) in zip(panels[1:], errors, strict=False):
        axes.set(xlabel="time ahead (s)", title=f"{name}, open loop")
        _open_loop_panel(axes, {"model": rows}, still=True)
    return figure
