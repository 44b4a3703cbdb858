"""Who arrives, how fast and on which ways: tables and figures from the records of `driving`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import binomtest

from sidm.experiments.animation import film
from sidm.experiments.claims import Claim, difference_claim
from sidm.experiments.drawing import METHOD_STYLES, finish, half_width, lay_ground, side_by_side, styled
from sidm.experiments.driving import ARRIVED, KEPT, Drive, Driven, episode
from sidm.experiments.methods import COMPARED
from sidm.experiments.statistics import Interval
from sidm.systems import SYSTEMS

OTHERS = {"simulator": "planned in the simulator", "straight": "straight ahead"}
LOOKS: dict[str, dict[str, Any]] = {
    "simulator": {"color": "#009E73", "linestyle": "-."},
    "straight": {"color": "#555555", "linestyle": ":"},
}


def label(about: Drive) -> str:
    """For figures and tables."""
    if about.trial is None:
        return OTHERS[about.driver]
    return f"model {METHOD_STYLES[about.trial.method]['label']}, {about.trial.novice_minutes:g} min"


class Score(NamedTuple):
    """A driver's episodes in numbers; times and lengths are of those that arrived."""

    about: Drive
    episodes: int
    arrived: Interval  # share of the episodes, with Wilson's 95 % interval
    seconds: float  # median; NaN where none arrived
    detour: float  # median of path length by straight distance
    ends: dict[str, int]  # of the others, by cause
    plans_per_second: float


def score(found: Driven) -> Score:
    """The numbers of one driver."""
    here = np.array([end == "arrived" for end in found.ended])
    count, total = int(here.sum()), len(here)
    shares = binomtest(count, total).proportion_ci(method="wilson")
    detours = np.array(found.length) / (np.array(found.away) - ARRIVED)
    seconds, detour = (
        float(np.median(np.array(some)[here])) if count else float("nan") for some in (found.seconds, detours)
    )
    ends = Counter(end for end in found.ended if end != "arrived")
    arrived = Interval(count / total, shares.low, shares.high)
    return Score(found.about, total, arrived, seconds, detour, dict(ends), found.plans_per_second)


def claims(found: Sequence[Driven], system: str) -> list[Claim]:
    """Whether a model with SIDM drives to more goals than one without, of the same data, over the same episodes."""
    models = {
        (one.about.trial.method, one.about.trial.novice_minutes): np.array(one.ended) != "arrived"
        for one in found
        if one.about.system == system and one.about.trial is not None
    }
    table = []
    for minutes in sorted({size for _, size in models}):
        sides = [models.get((method, minutes)) for method in COMPARED]
        known = [side for side in sides if side is not None]
        pairs = np.stack(known, axis=1).astype(float) if len(known) == 2 else np.zeros((0, 2))
        words = f"{system}: a smaller share of goals missed with the SIDM's model than without, at {minutes:g} min"
        table.append(difference_claim(words, "not measured", pairs))
    return table


@styled
def arrivals_figure(found: Sequence[Driven], systems: Sequence[str] = tuple(SYSTEMS)) -> Figure:
    """Share of goals reached by the data that the model has learnt from; level lines are the other drivers."""
    figure, panels = side_by_side(len(systems))
    for axes, system in zip(panels, systems, strict=True):
        scores = [score(one) for one in found if one.about.system == system]
        axes.set(xlabel="novice data of the model (min)", ylabel="goals reached (-)", title=system, ylim=(-0.03, 1.03))
        sizes = _draw_models(axes, scores)
        for one in scores:
            if one.about.trial is None:
                axes.axhline(one.arrived.value, label=label(one.about), marker="", **LOOKS[one.about.driver])
                axes.axhspan(one.arrived.low, one.arrived.high, color=LOOKS[one.about.driver]["color"], alpha=0.1, lw=0)
        finish(axes, sizes)
    return figure


def _draw_models(axes: Axes, scores: Sequence[Score]) -> set[float]:
    """Points of the learned models, and their sizes."""
    sizes: set[float] = set()
    for number, method in enumerate(dict.fromkeys(one.about.trial.method for one in scores if one.about.trial)):
        mine = [one for one in scores if one.about.trial and one.about.trial.method == method]
        minutes = np.array([one.about.trial.novice_minutes for one in mine if one.about.trial])
        share = np.array([one.arrived for one in mine])  # (M, 3)
        reach = np.abs(share[:, 1:] - share[:, :1]).T
        axes.errorbar(minutes * (0.96 + 0.08 * number), share[:, 0], reach, capsize=3, **METHOD_STYLES[method])
        sizes |= set(minutes.tolist())
    if sizes:
        axes.set_xscale("log")
    return sizes


@styled
def paths_figure(found: Sequence[Driven], system: str) -> Figure:
    """The ways that drivers took over the first grounds, seen from above; a circle around each goal."""
    figure, panels = side_by_side(KEPT, columns=2)
    mine = [one for one in found if one.about.system == system]
    for number, axes in enumerate(panels):
        axes.set(xlabel="x (m)", ylabel="y (m)", title=f"episode {number}", aspect="equal")
        if mine:
            _draw_ways(axes, mine, number)
        finish(axes, legend=number == 0)
    return figure


def _looks(drivers: Sequence[Driven]) -> list[dict[str, Any]]:
    """How the drivers' ways are drawn; of a method, those of less data are paler."""
    sizes = sorted({driver.about.trial.novice_minutes for driver in drivers if driver.about.trial})
    shades = dict(zip(sizes, np.linspace(0.35, 1.0, len(sizes)) if len(sizes) > 1 else [1.0], strict=True))
    looks = []
    for about in (driver.about for driver in drivers):
        look = LOOKS.get(about.driver, {})
        if about.trial:
            style, shade = METHOD_STYLES[about.trial.method], shades[about.trial.novice_minutes]
            look = {"color": style["color"], "linestyle": style["linestyle"], "alpha": shade}
        looks.append(look | {"label": label(about)})
    return looks


def driving_film(found: Sequence[Driven], system: str, number: int = 0) -> bytes:
    """An animated GIF of an episode, seen from above: all drivers set out together, each stands where it ended.

    Raises:
        ValueError: no driver of the system is stored.
    """
    mine = [one for one in found if one.about.system == system]
    if not mine:
        raise ValueError(f"no driver of {system} is stored")
    one = episode(system, number)
    return film([np.array(driver.paths[number]) for driver in mine], _looks(mine), one.heights, one.goal)


def _draw_ways(axes: Axes, drivers: Sequence[Driven], number: int) -> None:
    """One episode's ground, goal and ways."""
    one = episode(drivers[0].about.system, number)
    lay_ground(axes, one.heights, one.heights.min(), one.heights.max())
    for driver, look in zip(drivers, _looks(drivers), strict=True):
        axes.plot(*np.array(driver.paths[number]).T, marker="", **look)
    axes.add_patch(plt.Circle(tuple(one.goal), ARRIVED, fill=False, color="black"))
    every = np.vstack([*(np.array(driver.paths[number]) for driver in drivers), one.goal])
    middle, reach = (every.max(0) + every.min(0)) / 2, max(np.ptp(every, axis=0)) / 2 + 1
    limit = half_width(one.heights)
    axes.set(xlim=np.clip(middle[0] + np.array([-reach, reach]), -limit, limit))
    axes.set(ylim=np.clip(middle[1] + np.array([-reach, reach]), -limit, limit))
