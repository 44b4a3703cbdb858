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
from sidm.experiments.claims import CONTRARY, DIRECTION, NOT_SEEN, Claim, difference_claim
from sidm.experiments.drawing import (
    METHOD_STYLES,
    finish,
    half_width,
    lay_ground,
    legend_below,
    side_by_side,
    styled,
)
from sidm.experiments.drivers import ARRIVED
from sidm.experiments.driving import KEPT, Driven, episode
from sidm.experiments.methods import COMPARED
from sidm.experiments.statistics import FEWEST_SEEDS, Interval, interval
from sidm.systems import SYSTEMS

PAPER = "not measured"
SHOWN = 4  # episodes whose ways are drawn
SHORT = {"corrected_averaged": "expert corrected"}  # of labels that would fill a picture
OTHERS = {"simulator": "planned in the simulator", "straight": "straight ahead"}
LOOKS: dict[str, dict[str, Any]] = {
    "simulator": {"color": "#009E73", "linestyle": "-."},
    "straight": {"color": "#555555", "linestyle": ":"},
}


class Way(NamedTuple):
    """One way to drive: all models of a method and size, or one of the others."""

    system: str
    kind: str  # 'model', 'simulator' or 'straight'
    method: str  # of a model
    minutes: float  # of a model's data; 0 of the others
    parts: list[Driven]  # the records, one a seed

    @property
    def label(self) -> str:
        """For figures and tables."""
        if not self.method:
            return OTHERS[self.kind]
        return f"{SHORT.get(self.method) or METHOD_STYLES[self.method]['label']}, {self.minutes:g} min"

    def path(self, number: int) -> np.ndarray | None:
        """The way (K + 1, 2) of an episode below KEPT; None where it was not driven."""
        for one in self.parts:
            kept = [episode for episode in one.about.episodes if episode < KEPT]
            if number in kept:
                return np.array(one.paths[kept.index(number)])
        return None


def drivers(found: Iterable[Driven], system: str) -> list[Way]:
    """A system's ways to drive, in the order in which they are first met."""
    groups: dict[tuple[str, str, float], list[Driven]] = {}
    for one in found:
        if one.about.system == system:
            trial = one.about.trial
            key = (one.about.driver, trial.method, trial.novice_minutes) if trial else (one.about.driver, "", 0.0)
            groups.setdefault(key, []).append(one)
    return [Way(system, *key, parts) for key, parts in groups.items()]


class Score(NamedTuple):
    """A driver's episodes in numbers; times and lengths are medians over those in which it arrived, NaN without."""

    models: int  # that share the episodes, one a seed; 0 of the drivers without
    episodes: int
    arrived: Interval  # share of the episodes, with Wilson's 95 % interval: of these models, over episodes
    seconds: float
    length: float  # m
    detour: float  # path length by straight distance
    ends: dict[str, int]  # of the others, by cause
    surprise: float  # m, from where a plan led to where the robot was at the next, mean over the episodes
    top_speed: float  # m/s, mean over the episodes
    plans_per_second: tuple[float, float]  # of the median plan, and of the slowest 5 %; 0 where none is made


def score(driver: Way) -> Score:
    """The numbers of one driver."""

    def of(name: str) -> np.ndarray:
        return np.array([value for one in driver.parts for value in getattr(one, name)])

    here, ends = of("ended") == "arrived", Counter(of("ended").tolist())
    ends.pop("arrived", None)
    count, total = int(here.sum()), len(here)
    shares = binomtest(count, total).proportion_ci(method="wilson")
    ways = (of("seconds"), of("length"), of("length") / (of("away") - ARRIVED))
    seconds, length, detour = (float(np.median(some[here])) if count else float("nan") for some in ways)
    pace = [(one.plan_seconds, one.slowest_plan_seconds) for one in driver.parts if one.plans]
    often, seldom = 1 / np.median(pace, axis=0) if pace else (0.0, 0.0)
    return Score(
        models=len(driver.parts) if driver.method else 0,
        episodes=total,
        arrived=Interval(count / total, shares.low, shares.high),
        seconds=seconds,
        length=length,
        detour=detour,
        ends=dict(ends),
        surprise=float(of("surprise").mean()),
        top_speed=float(of("top_speed").mean()),
        plans_per_second=(float(often), float(seldom)),
    )


def outcomes(driver: Way) -> dict[int, tuple[bool, float]]:
    """Of each episode by its number, whether the goal was missed, and how many seconds were driven."""
    return {
        number: (end != "arrived", seconds)
        for one in driver.parts
        for number, end, seconds in zip(one.about.episodes, one.ended, one.seconds, strict=True)
    }


def paired(one: Way, other: Way) -> np.ndarray:
    """(E, 2) of 1 for a goal that was missed, over the episodes that both drove."""
    mine, theirs = outcomes(one), outcomes(other)
    return np.array([(mine[number][0], theirs[number][0]) for number in sorted(mine.keys() & theirs.keys())], float)


def sooner(one: Way, other: Way) -> np.ndarray:
    """(E, 2) of s until the goal, over the episodes in which both reached it."""
    mine, theirs = (
        {number: seconds for number, (missed, seconds) in outcomes(way).items() if not missed} for way in (one, other)
    )
    return np.array([(mine[number], theirs[number]) for number in sorted(mine.keys() & theirs.keys())]).reshape(-1, 2)


class Beside(NamedTuple):
    """How many more goals a model's driver reached than another driver, of the same episodes, and how much sooner."""

    way: Way
    other: Way
    episodes: int
    more: Interval | None  # share of the episodes; None where all ended alike
    both: int  # episodes in which both reached the goal
    sooner: Interval | None  # s, mean over these; None where there are fewer than three

    @property
    def more_words(self) -> str:
        """For a table."""
        return self.more.words(2) if self.more else "none differs"

    @property
    def sooner_words(self) -> str:
        """For a table."""
        return f"{self.sooner.words(2)} ({self.both})" if self.sooner else "-"


def beside(found: Iterable[Driven], system: str) -> list[Beside]:
    """Every model beside the drivers without: the floor and the ceiling."""
    every, table = drivers(found, system), []
    for way in every:
        for other in every:
            if way.method and not other.method:
                ends, times = paired(way, other), sooner(way, other)
                more = _less(ends) if (ends[:, 0] != ends[:, 1]).any() else None
                early = _less(times) if len(times) >= FEWEST_SEEDS else None
                table.append(Beside(way, other, len(ends), more, len(times), early))
    return table


def _less(pairs: np.ndarray) -> Interval:
    """By how much the first of paired values (E, 2) is smaller, mean over the pairs."""
    return interval(lambda some: float((some[:, 1] - some[:, 0]).mean()), pairs)


def _goals_claim(words: str, paper: str, pairs: np.ndarray) -> Claim:
    """A claim that fewer goals are missed; few pairs that differ make no verdict by the exact test (McNemar's)."""
    claim, first = difference_claim(words, paper, pairs), int((pairs[:, 0] < pairs[:, 1]).sum())
    differ = int((pairs[:, 0] != pairs[:, 1]).sum())
    if len(pairs) and not differ:
        claim = claim._replace(ours=f"none of {len(pairs)} episodes differs", interval=None)
    if claim.verdict in (DIRECTION, CONTRARY) and binomtest(first, differ).pvalue >= 0.05:
        claim = claim._replace(verdict=NOT_SEEN)
    return claim


def claims(found: Iterable[Driven], system: str) -> list[Claim]:
    """Whether models with SIDM miss fewer goals than those without, of the same data, and get there sooner.

    An episode is a pair; of the time, one in which both reach the goal.
    """
    every = {(driver.method, driver.minutes): driver for driver in drivers(found, system) if driver.method}
    table = []
    for minutes in sorted({size for method, size in every if method in COMPARED}):
        one, other = (every.get((method, minutes)) for method in COMPARED)
        pairs, times = (how(one, other) if one and other else np.zeros((0, 2)) for how in (paired, sooner))
        words = f"{system}: {{}} with the SIDM's models than without, at {minutes:g} min"
        table.append(_goals_claim(words.format("a smaller share of goals missed"), PAPER, pairs.reshape(-1, 2)))
        table.append(difference_claim(words.format("a shorter time to the goals that both reach"), PAPER, times, " s"))
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
        finish(axes, sizes, legend=False)
    legend_below(figure, panels)
    return figure


def _draw_models(axes: Axes, every: Sequence[Way]) -> set[float]:
    """Points of the learned models, and their sizes."""
    sizes: set[float] = set()
    for number, method in enumerate(dict.fromkeys(one.method for one in every if one.method)):
        mine = [one for one in every if one.method == method]
        minutes = np.array([one.minutes for one in mine])
        share = np.array([score(one).arrived for one in mine])  # (M, 3)
        reach = np.abs(share[:, 1:] - share[:, :1]).T
        look = METHOD_STYLES[method] | ({"label": SHORT[method]} if method in SHORT else {})
        axes.errorbar(minutes * (0.96 + 0.08 * number), share[:, 0], reach, capsize=3, **look)
        sizes |= set(minutes.tolist())
    if sizes:
        axes.set_xscale("log")
    return sizes


@styled
def paths_figure(found: Iterable[Driven], system: str) -> Figure:
    """The ways that drivers took over the first grounds, seen from above; a circle around each goal."""
    figure, panels = side_by_side(SHOWN, columns=2)
    mine = drivers(found, system)
    for number, axes in enumerate(panels):
        axes.set(xlabel="x (m)", ylabel="y (m)", title=f"episode {number}", aspect="equal")
        if any(one.path(number) is not None for one in mine):
            _draw_ways(axes, mine, number)
        finish(axes, legend=False)
    legend_below(figure, panels)
    return figure


def _looks(every: Sequence[Way]) -> list[dict[str, Any]]:
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


def _draw_ways(axes: Axes, every: Sequence[Way], number: int) -> None:
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
