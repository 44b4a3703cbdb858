"""Who arrives, how fast and on which ways: tables and claims from the records of `measure`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy.stats import binomtest

from companion.beyond.drivers import ARRIVED
from companion.engine.frame import of_trials
from companion.figures.style import METHOD_STYLES
from companion.methods import COMPARED
from companion.statistics.claims import COLUMNS, judged
from companion.statistics.intervals import Interval, interval
from companion.statistics.pairs import beside

PAPER = "not measured"
#: of labels that would fill a picture
SHORT = {"corrected_averaged": "expert corrected"}
OTHERS = {"simulator": "planned in the simulator", "straight": "straight to the goal"}
#: what tells the drivers apart; of a model's data, min
DRIVER = ["system", "driver", "method", "novice_minutes"]
#: values of a record that have one an episode
OF_EPISODE = ("ended", "length", "away", "top_speed", "surprise")


def name(driver: str, method: str) -> str:
    """Of a driver, for figures and tables."""
    if driver != "model":
        return OTHERS[driver]
    return str(SHORT.get(method) or METHOD_STYLES[method]["label"])


def label(driver: str, method: str, minutes: float) -> str:
    """The same with the size of the model's data."""
    return name(driver, method) + (f", {minutes:g} min" if method else "")


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """A line an episode of a driver.

    DRIVER, with '' and 0 where there is no model, the model's `seed`, the `episode`,
    whether the goal was `missed`, the cause that `ended` it, `seconds` until then,
    `length` of the path, m, `away`, how far the goal was, m, `top_speed`, m/s,
    `surprise`, m, from where a plan led to where the robot was at the next, NaN of no
    plan; and the `path` (K + 1, 2), m, where it is stored.
    """
    mine = _drivers(frame)
    # those of the first episodes alone are kept
    paths = zip(mine.paths, mine.episodes, strict=True)
    mine["path"] = [
        [*map(np.array, some), *[None] * (len(episodes) - len(some))]
        for some, episodes in paths
    ]
    values = ["episodes", "path", *OF_EPISODE, "found_seconds"]
    found = mine[[*DRIVER, "seed", "plans", *values]].explode(values, ignore_index=True)
    found = found.rename(columns={"episodes": "episode", "found_seconds": "seconds"})
    found = found.astype(
        dict.fromkeys(["novice_minutes", "seconds", *OF_EPISODE[1:]], float)
        | {"episode": int}
    )
    found["surprise"] = found.surprise.where(found.pop("plans") > 0)
    return found.assign(missed=(found.ended != "arrived").astype(float))


def _drivers(frame: pd.DataFrame) -> pd.DataFrame:
    """Records with '' and 0 where a driver has no model."""
    mine = of_trials(frame)
    model = mine.driver == "model"
    values = {"method": "", "novice_minutes": 0.0, "seed": 0}
    return mine.assign(
        **{name: mine[name].where(model, none) for name, none in values.items()}
    )


def scores(frame: pd.DataFrame) -> pd.DataFrame:
    """A line a driver, in the order in which they are first met.

    `models` that share the `episodes`, one a seed; the share that `arrived` with `low`
    and `high`, Wilson's 95 % interval, of these models over episodes; medians over
    those in which it arrived of `seconds`, `length`, m, and `detour`, path by straight
    distance; the other `ends` by cause; means of `surprise` and `top_speed`; and plans
    a second, `often` by the median plan and `seldom` by the slowest 5 %.
    """
    pace = _drivers(frame[frame.plans > 0]).astype({"novice_minutes": float})
    often = 1 / pace.groupby(DRIVER)[["plan_seconds", "slowest_plan_seconds"]].median()
    lines = []
    for key, some in table(frame).groupby(DRIVER, sort=False):
        here = some[some.missed == 0]
        share = binomtest(len(here), len(some)).proportion_ci(method="wilson")
        ends = some.ended[some.missed == 1].value_counts(sort=False)
        plans = often.loc[key].tolist() if key in often.index else [0.0, 0.0]
        lines.append(
            (
                *key,
                some.seed.nunique() if key[2] else 0,
                len(some),
                len(here) / len(some),
                share.low,
                share.high,
                here.seconds.median(),
                here.length.median(),
                (here.length / (here.away - ARRIVED)).median(),
                ", ".join(f"{cause} {count}" for cause, count in ends.items()),
                some.surprise.mean(),
                some.top_speed.mean(),
                *plans,
            )
        )
    names = [
        "models",
        "episodes",
        "arrived",
        "low",
        "high",
        "seconds",
        "length",
        "detour",
        "ends",
        "surprise",
        "top_speed",
        "often",
        "seldom",
    ]
    return pd.DataFrame(lines, columns=[*DRIVER, *names])


def rivals(table: pd.DataFrame) -> pd.DataFrame:
    """Every model beside the drivers without, and with SIDM beside without of the same data, on the same episodes.

    DRIVER and the `other`'s label; `episodes` that both drove; `more` goals, which the
    other missed, and `fewer`; `chance` of such a difference or a greater one between
    equals, by McNemar's exact test; goals that `both` reached, and how much `sooner`
    there, s, with `low` and `high`, over episodes.
    """
    lines = []
    for system, every in table.groupby("system", sort=False):
        groups = list(every.groupby(DRIVER[1:], sort=False))
        for mine, own in groups:
            for theirs, other in groups:
                same_data = (mine[1], theirs[1]) == COMPARED and mine[2] == theirs[2]
                if mine[1] and (same_data or not theirs[1]):
                    lines.append((system, *mine, label(*theirs), *_paired(own, other)))
    names = [
        "other",
        "episodes",
        "more",
        "fewer",
        "chance",
        "both",
        "sooner",
        "low",
        "high",
    ]
    found = pd.DataFrame(lines, columns=[*DRIVER, *names])
    return found[found.episodes > 0].reset_index(drop=True)


def _paired(own: pd.DataFrame, other: pd.DataFrame) -> tuple:
    """Two drivers in the episodes that both drove."""
    both = own.merge(other, on="episode").sort_values("episode")
    more, fewer = (
        int((both.missed_x < both.missed_y).sum()),
        int((both.missed_x > both.missed_y).sum()),
    )
    chance = float(binomtest(more, more + fewer).pvalue) if more + fewer else 1.0
    reached = both[(both.missed_x == 0) & (both.missed_y == 0)]
    times = (reached.seconds_y - reached.seconds_x).to_numpy(float)
    early = (
        interval(lambda some: float(some.mean()), times)
        if len(times)
        else Interval(np.nan, np.nan, np.nan)
    )
    return len(both), more, fewer, chance, len(times), *early


def claims(table: pd.DataFrame) -> pd.DataFrame:
    """Whether models with SIDM miss fewer goals than those without, and get sooner to those that both reach.

    A seed is a pair: the means over its episodes, of all sizes that both sides have
    driven.
    """
    point = ["system", "novice_minutes", "episode"]
    own, other = (table[table.method == method] for method in COMPARED)
    both = own.merge(
        other[[*point, "missed", "seconds"]], on=point, suffixes=("", "_other")
    )
    reached = both[(both.missed == 0) & (both.missed_other == 0)]
    parts = []
    for words, some, value, unit in (
        ("goals missed (share)", both, "missed", ""),
        ("time to the goals that both reach", reached, "seconds", "s"),
    ):
        means = (
            some.groupby(["system", "seed"])[[value, f"{value}_other"]]
            .mean()
            .reset_index()
        )
        without = means.drop(columns=value).rename(columns={f"{value}_other": value})
        found = beside(
            means, without, on=["system"], by=[], value=value, difference=True
        )
        sizes = [
            _sizes(both[both.system == system].novice_minutes.unique())
            for system in found.system
        ]
        names = [
            f"{words}, with SIDM's models minus without, {some} min" for some in sizes
        ]
        parts.append(judged(found, names, PAPER, unit=unit))
    return pd.concat(parts).sort_values("system", kind="stable", ignore_index=True)[
        list(COLUMNS)
    ]


def _sizes(minutes: Sequence[float]) -> str:
    return ", ".join(f"{one:g}" for one in sorted(minutes))
