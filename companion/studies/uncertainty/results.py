"""How sure the models are, and whether rightly so: tables and figures from the records of `measure`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.beyond.particles import LEVELS, QUANTILES
from companion.engine.frame import of_trials
from companion.figures.style import LOSS_BY_SIZE, METHOD_STYLES, by_system, legend_below
from companion.statistics.claims import judged
from companion.statistics.pairs import beside
from sidm.drives import CONTROL_STEP, QUATERNION
from sidm.plots import finish, styled
from sidm.systems import SYSTEMS

WORDS = {True: "by likelihood", False: "deterministic"}
DATA = ["system", "novice_minutes", "method"]
POINT = [*DATA, "likelihood"]


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """Models by likelihood and their deterministic twins: a line a system, size, method and way of training.

    Returns:
        POINT, `seeds`; means of the `loss` of equation (1), the `nll`, nats a sample,
        and `constant`: the NLL about the same means with the best spread that is the
        same everywhere; and of models by likelihood the `difference` of the NLL to the
        twin's, paired by seed, with the ends `low` and `high` of its interval.
    """
    mine = of_trials(frame)
    mine = mine.assign(
        constant=[constant_spread(losses) for losses in mine.component_losses]
    )
    found = (
        mine.groupby(POINT, sort=False)
        .agg(
            seeds=("seed", "size"),
            loss=("validation_loss", "mean"),
            nll=("nll", "mean"),
            constant=("constant", "mean"),
        )
        .reset_index()
    )
    by = mine.likelihood.astype(bool)
    less = beside(
        mine[by], mine[~by], on=DATA, by=["likelihood"], value="nll", difference=True
    )
    return found.merge(
        less[[*POINT, "difference", "low", "high"]], how="left", on=POINT
    )


def constant_spread(component_losses: Sequence[float]) -> float:
    """The NLL of normal distributions about a model's means, their spreads the best that are the same everywhere."""
    return float(0.5 * np.log(2 * math.pi * math.e * np.array(component_losses)).sum())


def coverage(frame: pd.DataFrame) -> pd.DataFrame:
    """How much of what happened the central intervals hold, means over seeds: a line a model and level.

    Returns:
        POINT, `level`; the share held in `one_step`, the mean over the 13 components,
        and its `least` and `most` of them; the same after the `rollout`, of forward,
        sideways and heading, `rollout_least` and `rollout_most`; the intervals' `width`
        there, (3,) m, m, rad; and the `position` error there, m.
    """
    lines = []
    for point, some in of_trials(frame).groupby(POINT, sort=False):
        one_step = np.mean(some.coverage.tolist(), axis=0)  # (L, 13)
        rollout, width = (
            np.mean(steps.tolist(), axis=0)[:, -1]
            for steps in (some.steps_coverage, some.steps_width)
        )
        position = float(some.position_error.str[-1].mean())
        for number, level in enumerate(LEVELS):
            held = [
                of(share[number])
                for share in (one_step, rollout)
                for of in (np.mean, np.min, np.max)
            ]
            lines.append((*point, level, *held, width[number], position))
    names = [
        "one_step",
        "least",
        "most",
        "rollout",
        "rollout_least",
        "rollout_most",
        "width",
        "position",
    ]
    return pd.DataFrame(lines, columns=[*POINT, "level", *names])


def quantiles(frame: pd.DataFrame) -> pd.DataFrame:
    """NLL of single steps by quantile, its `mean` and that of the quaternion's `w` alone: means over seeds by POINT."""
    mine = of_trials(frame)
    names = [f"{level:.0%}" for level in QUANTILES]
    values = {
        name: mine.nll_quantiles.str[number].astype(float)
        for number, name in enumerate(names)
    }
    last = range(13)[QUATERNION][-1]
    mine = mine.assign(
        **values, mean=mine.nll, w=mine.component_nll.str[last].astype(float)
    )
    return mine.groupby(POINT, sort=False)[[*names, "mean", "w"]].mean().reset_index()


def claims(table: pd.DataFrame) -> pd.DataFrame:
    """Whether a transition is likelier under distributions than under the twin, at each size with SIDM."""
    mine = table[(table.method == "sidm") & table.likelihood.astype(bool)]
    words = [
        f"NLL with distributions less the twin's, SIDM, {minutes:g} min"
        for minutes in mine.novice_minutes
    ]
    return judged(mine, words, "an alternative (section 3.2)", unit="nats")


def _look(method: str, likelihood: bool) -> dict[str, Any]:
    """Of a line; the twin's marks are hollow."""
    style = METHOD_STYLES[method] | {
        "label": f"{METHOD_STYLES[method]['label']}, {WORDS[likelihood]}"
    }
    return style if likelihood else style | {"mfc": "white", "linewidth": 1}


@styled
def figure(table: pd.DataFrame, systems: Sequence[str] = tuple(SYSTEMS)) -> Figure:
    """Figure 3's points: the loss of equation (1) of the means, trained by likelihood and deterministically."""
    figure, plots = by_system(table, systems, **LOSS_BY_SIZE)
    for axes, mine in plots:
        for (method, by), line in mine.groupby(["method", "likelihood"], sort=False):
            axes.plot(line.novice_minutes, line.loss, **_look(method, bool(by)))
        finish(axes, mine.novice_minutes)
    return figure


@styled
def coverage_figure(
    frame: pd.DataFrame, minutes: float, systems: Sequence[str] = tuple(SYSTEMS)
) -> Figure:
    """How often what happened lies within the particles' intervals, along rollouts of models of one size."""
    every = of_trials(frame)
    axis: dict[str, Any] = dict(
        xlabel="time (s)", ylabel="share of cases within the interval (-)", ylim=(0, 1)
    )
    every = every[every.novice_minutes == minutes]
    figure, plots = by_system(every, systems, f"{{}}, {minutes:g} min", **axis)
    for axes, mine in plots:
        for (method, by), some in mine.groupby(["method", "likelihood"], sort=False):
            mean, look = (
                np.mean(some.steps_coverage.tolist(), axis=(0, -1)),
                _look(method, bool(by)),
            )
            time = CONTROL_STEP * (1 + np.arange(mean.shape[1]))
            for number, level in enumerate(mean):
                axes.plot(
                    time,
                    level,
                    **look | {"marker": "", "label": None if number else look["label"]},
                )
        for level in LEVELS if len(mine) else ():
            axes.axhline(level, color="0.5", lw=1, linestyle="-", marker="")
            axes.text(
                2.5,
                level - 0.01,
                f"{level:.0%} intervals should hold this",
                ha="right",
                va="top",
                fontsize=9,
            )
        finish(axes, legend=False)
    legend_below(figure, figure.axes)
    return figure
