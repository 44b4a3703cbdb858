"""Who arrives, how fast and on which ways: tables and figures from the records of `driving`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import binomtest

from sidm.experiments.animation import film
from sidm.experiments.claims import Claim, difference_claim
from sidm.experiments.drawing import METHOD_STYLES, finish, half_width, lay_ground, side_by_side, styled
from sidm.experiments.driving import ARRIVED, KEPT, Driven, episode
from sidm.experiments.methods import COMPARED
from sidm.experiments.statistics import Interval
from sidm.systems import SYSTEMS

OTHERS = {"simulator": "planned in the simulator", "straight": "straight ahead"}
LOOKS: dict[str, dict[str, Any]] = {
    "simulator": {"color": "#009E73", "linestyle": "-."},
    "straight": {"color": "#555555", "linestyle": ":"},
}


class Driver(NamedTuple):
    """One way to drive: all models of a method and size, or one of the others."""

    system: str
    kind: str  # 'model', 'simulator' or 'straight'
    method: str  # of a model
    minutes: float  # of a model's data; 0 of the others
    parts: list[Driven]  # the records, one a seed

    @property
    def label(self) -> str:
        """For figures and tables."""
        words = f"model {METHOD_STYLES[self.method]['label']}, {self.minutes:g} min" if self.method else ""
        return words or OTHERS[self.kind]

    def path(self, number: int) -> np.ndarray | None:
        """The way (K + 1, 2) of an episode below KEPT; None where it was not driven."""
        for one in self.parts:
            kept = [episode for episode in one.about.episodes if episode < KEPT]
            if number in kept:
                return np.array(one.paths[kept.index(number)])
        return None


def drivers(found: Iterable[Driven], system: str) -> list[Driver]:
    """A system's ways to drive, in the order in which they are first met."""
    groups: dict[tuple[str, str, float], list[Driven]] = {}
    for one in found:
        if one.about.system == system:
            trial = one.about.trial
            key = (one.about.driver, trial.method, trial.novice_minutes) if trial else (one.about.driver, "", 0.0)
            groups.setdefault(key, []).append(one)
    return [Driver(system, *key, parts) for key, parts in groups.items()]


class Score(NamedTuple):
    """A driver's episodes in numbers; times and lengths are of those that arrived."""

    models: int  # that share the episodes, one a seed; 1 of the drivers without
    episodes: int
    arrived: Interval  # share of the episodes, with Wilson's 95 % interval: of these models, over episodes
    seconds: float  # median; NaN where none arrived
    detour: float  # median of path length by straight distance
    ends: dict[str, int]  # of the others, by cause
    plans_per_second: float


def score(driver: Driver) -> Score:
    """The numbers of one driver."""
    ended = [end for one in driver.parts for end in one.ended]
    here = np.array([end == "arrived" for end in ended])
    count, total = int(here.sum()), len(here)
    shares = binomtest(count, total).proportion_ci(method="wilson")
    seconds, length, away = (
        np.array([value for one in driver.parts for value in getattr(one, name)])
        for name in ("seconds", "length", "away")
    )
    medians = [
        float(np.median(some[here])) if count else float("nan") for some in (seconds, length / (away - ARRIVED))
    ]
    ends = Counter(end for end in ended if end != "arrived")
    pace = float(np.median([one.plans_per_second for one in driver.parts]))
    arrived = Interval(count / total, shares.low, shares.high)
    return Score(len(driver.parts), total, arrived, medians[0], medians[1], dict(ends), pace)


def claims(found: Iterable[Driven], system: str) -> list[Claim]:
    """Whether models with SIDM miss fewer goals than those without, of the same data; a seed is a pair of models."""
    missed = {
        (driver.method, driver.minutes): {
            one.about.trial.seed: float(np.mean([end != "arrived" for end in one.ended]))
            for one in driver.parts
            if one.about.trial
        }
        for driver in drivers(found, system)
        if driver.method
    }
    table = []
    for minutes in sorted({size for _, size in missed}):
        sides = [missed.get((method, minutes), {}) for method in COMPARED]
        pairs = np.array([[side[seed] for side in sides] for seed in sorted(sides[0].keys() & sides[1].keys())])
        words = f"{system}: a smaller share of goals missed with the SIDM's models than without, at {minutes:g} min"
        table.append(difference_claim(words, "not measured", pairs.reshape(-1, 2)))
    return table


@styled
def arrivals_figure(found: Iterable[Driven], systems: Sequence[str] = tuple(SYSTEMS)) -> Figure:
    """Share of goals reached by the data that the model has learnt from; level lines are the other drivers."""
    figure, panels = side_by_side(len(systems))
    for axes, system in zip(panels, systems, strict=True):
        mine = drivers(found, system)
        axes.set(xlabel="novice data of the model (min)", ylabel="goals reached (-)", title=system, ylim=(-0.03, 1.03))
        sizes = _draw_models(axes, mine)
        for one in mine:
            if not one.method:
                share, look = score(one).arrived, LOOKS[one.kind]
                axes.axhline(share.value, label=one.label, marker="", **look)
                axes.axhspan(share.low, share.high, color=look["color"], alpha=0.1, lw=0)
        finish(axes, sizes)
    return figure


def _draw_models(axes: Axes, every: Sequence[Driver]) -> set[float]:
    """Points of the learned models, and their sizes."""
    sizes: set[float] = set()
    for number, method in enumerate(dict.fromkeys(one.method for one in every if one.method)):
        mine = [one for one in every if one.method == method]
        minutes = np.array([one.minutes for one in mine])
        share = np.array([score(one).arrived for one in mine])  # (M, 3)
        reach = np.abs(share[:, 1:] - share[:, :1]).T
        axes.errorbar(minutes * (0.96 + 0.08 * number), share[:, 0], reach, capsize=3, **METHOD_STYLES[method])
        sizes |= set(minutes.tolist())
    if sizes:
        axes.set_xscale("log")
    return sizes


@styled
def paths_figure(found: Iterable[Driven], system: str) -> Figure:
    """The ways that drivers took over the first grounds, seen from above; a circle around each goal."""
    figure, panels = side_by_side(KEPT, columns=2)
    mine = drivers(found, system)
    for number, axes in enumerate(panels):
        axes.set(xlabel="x (m)", ylabel="y (m)", title=f"episode {number}", aspect="equal")
        if any(one.path(number) is not None for one in mine):
            _draw_ways(axes, mine, number)
        finish(axes, legend=number == 0)
    return figure


def _looks(every: Sequence[Driver]) -> list[dict[str, Any]]:
    """How the drivers' ways are drawn; of a method, those of less data are paler."""
    sizes = sorted({one.minutes for one in every if one.method}, reverse=True)
    shades = {size: 1 - 0.65 * rank / max(len(sizes) - 1, 1) for rank, size in enumerate(sizes)}
    looks = []
    for one in every:
        look = LOOKS.get(one.kind, {})
        if one.method:
            style = METHOD_STYLES[one.method]
            look = {"color": style["color"], "linestyle": style["linestyle"], "alpha": shades[one.minutes]}
        looks.append(look | {"label": one.label})
    return looks


def driving_film(found: Iterable[Driven], system: str, number: int = 0) -> bytes:
    """An animated GIF of an episode, seen from above: all drivers set out together, each stands where it ended.

    Raises:
        ValueError: nobody has driven that episode.
    """
    every = drivers(found, system)
    ways = [(one.path(number), look) for one, look in zip(every, _looks(every), strict=True)]
    shown = [(way, look) for way, look in ways if way is not None]
    if not shown:
        raise ValueError(f"no driver of {system} has a stored way of episode {number}")
    one = episode(system, number)
    return film([way for way, _ in shown], [look for _, look in shown], one.heights, one.goal)


def _draw_ways(axes: Axes, every: Sequence[Driver], number: int) -> None:
    """One episode's ground, goal and ways."""
    one = episode(every[0].system, number)
    lay_ground(axes, one.heights, one.heights.min(), one.heights.max())
    points = [one.goal[None]]
    for driver, look in zip(every, _looks(every), strict=True):
        way = driver.path(number)
        if way is not None:
            axes.plot(*way.T, marker="", **look)
            points.append(way)
    axes.add_patch(plt.Circle(tuple(one.goal), ARRIVED, fill=False, color="black"))
    seen = np.vstack(points)
    middle, reach = (seen.max(0) + seen.min(0)) / 2, max(np.ptp(seen, axis=0)) / 2 + 1
    limit = half_width(one.heights)
    axes.set(xlim=np.clip(middle[0] + np.array([-reach, reach]), -limit, limit))
    axes.set(ylim=np.clip(middle[1] + np.array([-reach, reach]), -limit, limit))
