"""Who arrives, how fast and on which ways: tables and claims from the records of `driving`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import binomtest

from sidm.control.drivers import ARRIVED
from sidm.experiments.figures.style import METHOD_STYLES
from sidm.experiments.methods import COMPARED
from sidm.experiments.statistics.claims import NO_VERDICT, Claim, difference_claim
from sidm.experiments.statistics.intervals import FEWEST_SEEDS, Interval, interval
from sidm.experiments.studies.driving.drive import KEPT, Driven

PAPER = "not measured"
SHORT = {"corrected_averaged": "expert corrected"}  # of labels that would fill a picture
OTHERS = {"simulator": "planned in the simulator", "straight": "straight to the goal"}
UNLIKELY = 0.05  # of a difference between equals, which is told from less on


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
        return f"{self.name}, {self.minutes:g} min" if self.method else self.name

    @property
    def name(self) -> str:
        """The same without the size."""
        if not self.method:
            return OTHERS[self.kind]
        return str(SHORT.get(self.method) or METHOD_STYLES[self.method]["label"])

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
    surprise: float  # m, from where a plan led to where the robot was at the next, mean over the episodes; NaN of none
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
        surprise=float(of("surprise").mean()) if pace else float("nan"),
        top_speed=float(of("top_speed").mean()),
        plans_per_second=(float(often), float(seldom)),
    )


def in_short(found: Iterable[Driven], system: str) -> str:
    """How many goals each driver reached, and how many models do better or worse than who steers straight for them."""
    found = list(found)
    every = drivers(found, system)
    if not every:
        return f"{system}: not run"
    groups: dict[str, list[Way]] = {}
    for one in every:
        groups.setdefault(one.name, []).append(one)
    said = f"{system}, goals reached: {'; '.join(_reached(name, some) for name, some in groups.items())}."
    simulated, straight = (next((one for one in every if one.kind == kind), None) for kind in ("simulator", "straight"))
    if simulated and straight:
        ends = 1 - paired(simulated, straight)
        said += f" In the {len(ends)} episodes of the planner in the simulator, who steers straight reaches "
        said += f"{ends[:, 1].sum():.0f}, and the planner {ends[:, 0].sum():.0f}."
    rivals = [one for one in beside(found, system) if one.other.kind == "straight"]
    if rivals:
        told = [one for one in rivals if one.chance < UNLIKELY]
        more = sum(one.more > one.fewer for one in told)
        said += f" Of {len(rivals)} planners with models, McNemar's test finds {len(told) - more} that reach fewer "
        said += f"goals than who steers straight in the same episodes, and {more} that reach more (p < {UNLIKELY})."
    return said


def _reached(name: str, some: Sequence[Way]) -> str:
    """'with SIDM 24, 40 of 50 (1, 60 min)'."""
    ends = [[missed for missed, _ in outcomes(one).values()] for one in some]
    counts = ", ".join(f"{len(missed) - sum(missed)}" for missed in ends)
    totals = ", ".join(dict.fromkeys(f"{len(missed)}" for missed in ends))
    sizes = ", ".join(f"{one.minutes:g}" for one in some if one.method)
    return f"{name} {counts} of {totals}" + (f" ({sizes} min)" if sizes else "")


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
    common = sorted(mine.keys() & theirs.keys())
    return np.array([(mine[number][0], theirs[number][0]) for number in common], float).reshape(-1, 2)


def sooner(one: Way, other: Way) -> np.ndarray:
    """(E, 2) of s until the goal, over the episodes in which both reached it."""
    mine, theirs = (
        {number: seconds for number, (missed, seconds) in outcomes(way).items() if not missed} for way in (one, other)
    )
    return np.array([(mine[number], theirs[number]) for number in sorted(mine.keys() & theirs.keys())]).reshape(-1, 2)


class Beside(NamedTuple):
    """How many more goals a driver reached than another, of the same episodes, and how much sooner: of these models."""

    way: Way
    other: Way
    episodes: int  # that both drove
    more: int  # goals that the other missed
    fewer: int  # goals that only the other reached
    both: int  # goals that both reached
    sooner: Interval | None  # s, mean over these, interval over these; None where there are fewer than three

    @property
    def chance(self) -> float:
        """Probability of such a difference or a greater one between equals, by McNemar's exact test."""
        return float(binomtest(self.more, self.more + self.fewer).pvalue) if self.more + self.fewer else 1.0

    @property
    def sooner_words(self) -> str:
        """For a table."""
        return f"{self.sooner.words(2)} ({self.both})" if self.sooner else "-"


def beside(found: Iterable[Driven], system: str) -> list[Beside]:
    """Every model beside the floor and the ceiling, and with SIDM beside without, of the same data."""
    every, table = drivers(found, system), []
    for way in every:
        for other in every:
            rivals = (way.method, other.method) == COMPARED and way.minutes == other.minutes
            ends = paired(way, other)
            if way.method and (rivals or not other.method) and len(ends):
                (mine, theirs), times = ends.T.astype(bool), sooner(way, other)
                more, fewer = int((~mine & theirs).sum()), int((mine & ~theirs).sum())
                early = interval(_less, times) if len(times) >= FEWEST_SEEDS else None
                table.append(Beside(way, other, len(ends), more, fewer, len(times), early))
    return table


def _less(pairs: np.ndarray) -> float:
    """By how much the first of paired values (E, 2) is smaller, mean over the pairs."""
    return float((pairs[:, 1] - pairs[:, 0]).mean())


def claims(found: Iterable[Driven], system: str) -> list[Claim]:
    """Whether models with SIDM miss fewer goals than those without, and get sooner to those that both reach.

    A seed is a pair: the means over its episodes, of all sizes that both sides have driven.
    """
    every = {(driver.method, driver.minutes): driver for driver in drivers(found, system) if driver.method}
    one, other = COMPARED
    sizes = sorted({size for method, size in every if method == one and (other, size) in every})
    sides = [(every[one, size], every[other, size]) for size in sizes]
    words = f"{system}: {{}} with the SIDM's models than without, at {', '.join(f'{size:g}' for size in sizes)} min"
    fewer, quicker = words.format("fewer goals missed"), words.format("a shorter time to the goals that both reach")
    if not sizes:
        return []
    missed, times = _by_seed(sides, paired), _by_seed(sides, sooner)
    if len(missed) and not len(times):
        return [difference_claim(fewer, PAPER, missed), Claim(quicker, PAPER, "no goal that both reach", NO_VERDICT)]
    return [difference_claim(fewer, PAPER, missed), difference_claim(quicker, PAPER, times, " s")]


def _by_seed(sides: Iterable[tuple[Way, Way]], how: Callable[[Way, Way], np.ndarray]) -> np.ndarray:
    """(S, 2) means over a seed's episodes of what `how` pairs, all sizes together."""
    found: dict[int, list[np.ndarray]] = {}
    for one, other in sides:
        for part in one.parts:
            if part.about.trial:
                found.setdefault(part.about.trial.seed, []).append(how(one._replace(parts=[part]), other))
    pairs = [np.concatenate(some) for some in found.values()]
    return np.array([some.mean(0) for some in pairs if len(some)]).reshape(-1, 2)
