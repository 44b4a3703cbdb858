"""How sure the models are, and whether rightly so: tables and figures from the records of `uncertainty`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from sidm.experiments.figures.style import LOSS_LABEL, METHOD_STYLES, finish, side_by_side, styled
from sidm.experiments.methods import COMPARED
from sidm.experiments.statistics.claims import Claim, difference_claim
from sidm.experiments.statistics.intervals import Interval, interval
from sidm.experiments.studies.uncertainty.fit import Fitted
from sidm.learning.beyond.particles import LEVELS
from sidm.systems import SYSTEMS
from sidm.trajectory import CONTROL_STEP, QUATERNION

WORDS = {True: "by likelihood", False: "deterministic"}


class Line(NamedTuple):
    """Models of one kind at one size, means over seeds."""

    system: str
    method: str
    likelihood: bool
    minutes: float
    seeds: int
    loss: float  # equation (1)
    nll: float  # nats a sample
    constant: float  # nats a sample: the NLL with its own means and the best spread that is the same everywhere
    less: Interval | None  # the NLL less the twin's, paired by seed; None for the twin
    coverage: np.ndarray  # (L, 13) of one step
    last_coverage: np.ndarray  # (L, 3) after the last step of the rollouts
    last_width: np.ndarray  # (L, 3) of the intervals there: forward, sideways, m, heading, rad
    error: float  # m, position after the rollouts of the means


def likelihood_lines(found: Sequence[Fitted], system: str) -> list[Line]:
    """A line a method, size and way of training that is stored."""
    mine = [one for one in found if one.about.trial.system == system]
    sizes = sorted({one.about.trial.novice_minutes for one in mine})
    lines = []
    for minutes in sizes:
        for method in COMPARED:
            sides = {by: _seeds(mine, method, minutes, by) for by in (True, False)}
            for by, some in sides.items():
                if not some:
                    continue
                common = sorted(sides[True].keys() & sides[False].keys())
                less = None
                if by and common:
                    pairs = np.array([[side[seed].nll for side in sides.values()] for seed in common])
                    less = interval(lambda p: float((p[:, 0] - p[:, 1]).mean()), pairs)
                lines.append(_line(system, method, by, minutes, list(some.values()), less))
    return lines


def _seeds(found: Sequence[Fitted], method: str, minutes: float, likelihood: bool) -> dict[int, Fitted]:
    """Those of one kind, by seed."""
    wanted = method, minutes, likelihood
    return {
        one.about.trial.seed: one
        for one in found
        if (one.about.trial.method, one.about.trial.novice_minutes, one.about.likelihood) == wanted
    }


def _of(lines: Sequence[Line], method: str, likelihood: bool) -> list[Line]:
    """Those of one kind, a line a size."""
    return [line for line in lines if (line.method, line.likelihood) == (method, likelihood)]


def _line(
    system: str, method: str, likelihood: bool, minutes: float, some: Sequence[Fitted], less: Interval | None
) -> Line:
    loss, nll = (float(np.mean([getattr(one, name) for one in some])) for name in ("validation_loss", "nll"))
    constant = float(np.mean([constant_spread(one) for one in some]))
    coverage = np.mean([one.coverage for one in some], axis=0)
    last, width = (np.mean([getattr(one, f"steps_{name}") for one in some], axis=0)[:, -1] for name in
                   ("coverage", "width"))  # fmt: skip
    error = float(np.mean([one.position_error[-1] for one in some]))
    return Line(system, method, likelihood, minutes, len(some), loss, nll, constant, less, coverage, last, width, error)


def constant_spread(one: Fitted) -> float:
    """The NLL of normal distributions about a model's means, their spreads the best that are the same everywhere."""
    return float(0.5 * np.log(2 * math.pi * math.e * np.array(one.component_losses)).sum())


def nll_lines(found: Sequence[Fitted], system: str) -> list[tuple]:
    """A line of a table a method, way and size, means over seeds: NLL of single steps by quantile, their mean, of w."""
    mine = [one for one in found if one.about.trial.system == system]
    lines = []
    for minutes in sorted({one.about.trial.novice_minutes for one in mine}):
        for method in COMPARED:
            for by in (True, False):
                some = list(_seeds(mine, method, minutes, by).values())
                if some:
                    numbers = [(*one.nll_quantiles, one.nll, one.component_nll[QUATERNION][-1]) for one in some]
                    words = (f"{value:.1f}" for value in np.mean(numbers, axis=0))
                    lines.append((METHOD_STYLES[method]["label"], WORDS[by], minutes, *words))
    return lines


def in_short(found: Sequence[Fitted], system: str) -> str:
    """Whether distributions are likelier than the twin with SIDM, what they cost in loss, what their intervals hold."""
    lines = {way: _of(likelihood_lines(found, system), "sidm", way) for way in WORDS}
    by, twin = lines[True], lines[False]
    if not by or [line.minutes for line in by] != [line.minutes for line in twin]:
        return f"{system}: not run"
    likelier, less, unseen = (
        " and ".join(f"{line.minutes:g}" for line in by if line.less and line.less.side(0) == side)
        for side in (-1, 1, 0)
    )
    told = {"a transition is likelier under distributions than under the twin": likelier, "less likely": less,
            "no difference is seen": unseen}  # fmt: skip
    cost = [mine.loss / other.loss for mine, other in zip(by, twin, strict=True)]
    levels = " and ".join(f"{level:.0%}" for level in LEVELS)
    held, along = (
        "{} (the twin's {})".format(*(_mean_shares(some, name) for some in (by, twin)))
        for name in ("coverage", "last_coverage")
    )
    return (
        f"{system}, with SIDM: "
        + ", ".join(f"{words} with {sizes} min" for words, sizes in told.items() if sizes)
        + f"; the loss of their means is {min(cost):.3g} to {max(cost):.3g} times the twin's. In the mean over sizes, "
        f"intervals of {levels} hold {held} of what happens in one step, and {along} of the way and turn after 2.5 s."
    )


def _mean_shares(lines: Sequence[Line], name: str) -> str:
    """Coverage of each level, the mean over lines and quantities."""
    return " and ".join(f"{share:.0%}" for share in np.mean([getattr(line, name) for line in lines], axis=(0, -1)))


def claims(found: Sequence[Fitted], system: str) -> list[Claim]:
    """Whether a transition is likelier under distributions than under the twin, at each size with SIDM."""
    mine = [one for one in found if one.about.trial.system == system]
    table = []
    for minutes in sorted({one.about.trial.novice_minutes for one in mine}):
        by, twin = (_seeds(mine, "sidm", minutes, way) for way in (True, False))
        pairs = np.array([(by[seed].nll, twin[seed].nll) for seed in sorted(by.keys() & twin.keys())]).reshape(-1, 2)
        words = f"{system}: a smaller negative log-likelihood by distributions than the twin's, SIDM at {minutes:g} min"
        table.append(difference_claim(words, "an alternative (section 3.2)", pairs, " nats"))
    return table


def shares(coverage: np.ndarray) -> list[str]:
    """Coverage (L, N) for a table, a cell a level: the mean over N quantities, and the least and the most of them."""
    return [f"{level.mean():.0%} ({level.min():.0%} to {level.max():.0%})" for level in coverage]


def _look(method: str, likelihood: bool) -> dict[str, Any]:
    """Of a line; the twin's marks are hollow."""
    style = METHOD_STYLES[method] | {"label": f"{METHOD_STYLES[method]['label']}, {WORDS[likelihood]}"}
    return style if likelihood else style | {"mfc": "white", "linewidth": 1}


@styled
def loss_figure(found: Sequence[Fitted], systems: Sequence[str] = tuple(SYSTEMS)) -> Figure:
    """Figure 3's points: the loss of equation (1) of the means, trained by likelihood and deterministically."""
    figure, panels = side_by_side(len(systems))
    for axes, system in zip(panels, systems, strict=True):
        axes.set(xscale="log", yscale="log", xlabel="novice data (min)", ylabel=LOSS_LABEL, title=system)
        lines = likelihood_lines(found, system)
        for method in COMPARED:
            for by in WORDS:
                some = _of(lines, method, by)
                if some:
                    axes.plot([line.minutes for line in some], [line.loss for line in some], **_look(method, by))
        finish(axes, {line.minutes for line in lines})
    return figure


@styled
def coverage_figure(found: Sequence[Fitted], minutes: float, systems: Sequence[str] = tuple(SYSTEMS)) -> Figure:
    """How often what happened lies within the particles' intervals, along rollouts of models of one size."""
    figure, panels = side_by_side(len(systems))
    for axes, system in zip(panels, systems, strict=True):
        axes.set(xlabel="time (s)", ylabel="share within the interval (-)", ylim=(0, 1))
        axes.set_title(f"{system}, {minutes:g} min")
        drawn = False
        for method in COMPARED:
            for by in WORDS:
                some = list(_seeds([o for o in found if o.about.trial.system == system], method, minutes, by).values())
                if some:
                    mean, look = np.mean([one.steps_coverage for one in some], axis=(0, -1)), _look(method, by)
                    time = CONTROL_STEP * (1 + np.arange(mean.shape[1]))
                    for number, level in enumerate(mean):
                        axes.plot(time, level, **look | {"marker": "", "label": None if number else look["label"]})
                    drawn = True
        for level in LEVELS if drawn else ():
            axes.axhline(level, color="0.5", lw=1, linestyle="-", marker="")
        finish(axes)
    return figure
