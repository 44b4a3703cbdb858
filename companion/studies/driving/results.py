"""Tables and claims of driving: who arrives, how fast and on which paths."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd

from companion.extensions.drivers import ARRIVED
from companion.figures.style import METHOD_LABELS
from companion.methods import COMPARED
from companion.statistics.claims import COLUMNS, claim_rows
from companion.statistics.intervals import interval
from companion.statistics.pairs import interval_texts, paired_comparison
from ownrobot.comparison.statistics import Interval

#: Labels of methods, short where the whole one would fill a figure.
SHORT = METHOD_LABELS | {"corrected_averaged": "expert corrected"}
#: Labels of the drivers that have no learned model.
OTHERS = {"simulator": "planned in the simulator", "straight": "straight to the goal"}
FEWEST_BOTH = 3  # goals that two drivers reached, for a difference of their times
#: Columns that identify a driver; `novice_minutes` are those of a model's data.
DRIVER = ["system", "driver", "method", "novice_minutes"]
#: Numbers of a record that have an entry per episode.
OF_EPISODE = ["length", "away", "top_speed", "surprise"]
#: Columns of the tables of `scores` and of `rivals` after DRIVER.
SCORES = "models episodes arrived low high seconds length detour ends".split()
SCORES += "surprise top_speed often seldom".split()
RIVALS = "other episodes more fewer chance both sooner low high".split()


def label(driver: str, method: str, minutes: float) -> str:
    """The name of a driver in figures and tables, with the size of its model's data."""
    if driver != "model":
        return OTHERS[driver]
    return f"{SHORT[method]}, {minutes:g} min"


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """A row per driver and episode.

    Returns:
        DRIVER, with '' and 0 where there is no model; the model's `seed`; the
        `episode`; whether the goal was `missed`; the cause that `ended` the episode and
        the `seconds` until then; the `length` of the path, m; `away`, the distance from
        start to goal, m; `top_speed`, m/s; `surprise`, the mean distance between where
        a plan led and where the robot was at the next plan, m, NaN without plans; and
        the `path` (K + 1, 2), m, where it is stored.
    """
    rows = _drivers(frame)
    # only the paths of the first episodes are stored
    rows["path"] = [
        [*map(np.array, paths), *[None] * (len(episodes) - len(paths))]
        for paths, episodes in zip(rows.paths, rows.episodes, strict=True)
    ]
    rows["episode"], rows["seconds"] = rows.episodes, rows.found_seconds
    numbers = ["seconds", *OF_EPISODE]
    values = ["episode", "path", "ended", *numbers]
    long = rows[[*DRIVER, "seed", "plans", *values]].explode(values, ignore_index=True)
    kinds = dict.fromkeys(["novice_minutes", *numbers], float)
    long = long.astype(kinds | {"episode": int})
    long["surprise"] = long.surprise.where(long.pop("plans") > 0)
    return long.assign(missed=(long.ended != "arrived").astype(float))


def _drivers(frame: pd.DataFrame) -> pd.DataFrame:
    """Records with '' and 0 in the columns of a trial where a driver has no model."""
    model = frame.driver == "model"
    blanks = {"method": "", "novice_minutes": 0.0, "seed": 0}
    filled = {name: frame[name].where(model, blank) for name, blank in blanks.items()}
    return frame.assign(**filled)


def scores(frame: pd.DataFrame) -> pd.DataFrame:
    """A row per driver, in the order of the first record of each.

    Returns:
        DRIVER; the number of `models`, one per seed, that share the `episodes`; the
        share of episodes in which the driver `arrived` with `low` and `high`, Wilson's
        95 % interval over episodes for these models; medians over the episodes in which
        it arrived of `seconds`, `length`, m, and `detour`, the path divided by the
        straight distance; the other `ends` by cause; means of `surprise`, m, and
        `top_speed`, m/s; and plans a second, `often` by the median plan and `seldom` by
        the slowest 5 %.
    """
    from scipy.stats import binomtest  # late: it takes long to import

    pace = _drivers(frame[frame.plans > 0]).astype({"novice_minutes": float})
    often = 1 / pace.groupby(DRIVER)[["plan_seconds", "slowest_plan_seconds"]].median()
    rows = []
    for key, group in table(frame).groupby(DRIVER, sort=False):
        reached = group[group.missed == 0]
        share = binomtest(len(reached), len(group)).proportion_ci(method="wilson")
        ends = group.ended[group.missed == 1].value_counts(sort=False)
        models = group.seed.nunique() if key[2] else 0
        arrived = len(reached) / len(group), share.low, share.high
        detour = (reached.length / (reached.away - ARRIVED)).median()
        driven = reached.seconds.median(), reached.length.median(), detour
        causes = ", ".join(f"{cause} {count}" for cause, count in ends.items())
        means = group.surprise.mean(), group.top_speed.mean()
        plans = often.loc[key].tolist() if key in often.index else [0.0, 0.0]
        numbers = (models, len(group), *arrived, *driven, causes, *means, *plans)
        rows.append((*key, *numbers))
    return pd.DataFrame(rows, columns=[*DRIVER, *SCORES])


def reached(
    scores: pd.DataFrame, system: str, minutes: float, episodes: int
) -> dict[str, int]:
    """Goals reached in so many episodes, by method, or by driver without one.

    The methods have so many minutes of novice data.
    """
    rows = scores[(scores.system == system) & (scores.episodes == episodes)]
    rows = rows[rows.novice_minutes.isin([0.0, minutes])]
    goals = (rows.arrived * rows.episodes).astype(float).round().astype(int)
    drivers = rows.method.where(rows.method != "", rows.driver)
    return dict(zip(drivers, goals, strict=True))


def fewer_than_straight(rivals: pd.DataFrame) -> dict[str, int]:
    """Planners of each system that reach fewer goals than the straight driver.

    By McNemar's test at 0.05; of the table `rivals`.
    """
    beside = rivals[rivals.other == OTHERS["straight"]]
    behind = (beside.chance < 0.05) & (beside.more < beside.fewer)
    return behind.groupby(beside.system).sum().to_dict()


def scores_page(scores: pd.DataFrame) -> pd.DataFrame:
    """The table of `scores` with the columns and headings of a page."""
    pace = [
        f"{often:.3g}, {seldom:.3g}" if often else "-"
        for often, seldom in zip(scores.often, scores.seldom, strict=True)
    ]
    columns = {
        "system": scores.system,
        "driver": _labels(scores),
        "models": scores.models.replace(0, "-"),
        "episodes": scores.episodes,
        "reached (95 % interval)": _intervals(scores, "arrived"),
        "time (s)": scores.seconds,
        "metres": scores.length,
        "detour": scores.detour,
        "lost episodes": scores.ends.replace("", "-"),
        "plan error (m)": scores.surprise,
        "top speed (m/s)": scores.top_speed,
        "plans a second": pace,
    }
    return pd.DataFrame(columns)


def rivals_page(rivals: pd.DataFrame) -> pd.DataFrame:
    """The table of `rivals` with the columns and headings of a page."""
    sooner = [
        f"{text} ({both})" if both >= FEWEST_BOTH else "-"
        for text, both in zip(_intervals(rivals, "sooner"), rivals.both, strict=True)
    ]
    columns = ["other", "episodes", "more", "fewer", "chance"]
    page = rivals[["system", *columns]].assign(**{"sooner (s) (episodes)": sooner})
    page.insert(1, "driver", _labels(rivals))
    return page.rename(columns={"other": "compared with", "chance": "p"})


def _labels(table: pd.DataFrame) -> list[str]:
    return [label(*driver) for driver in table[DRIVER[1:]].itertuples(index=False)]


def _intervals(table: pd.DataFrame, value: str) -> list[str]:
    return interval_texts(table[[value, "low", "high"]], 2)


def rivals(table: pd.DataFrame) -> pd.DataFrame:
    """Pairs of drivers on the same episodes, a row per pair.

    Every model is compared with the drivers that have no model, and every model with
    SIDM with the model without SIDM that has the same data.

    Returns:
        DRIVER and the `other` driver's label; `episodes` that both drove; `more` goals
        that only the first reached and `fewer` that only the other reached; `chance` of
        such a difference or a greater one between equals, by McNemar's exact test; the
        number of goals that `both` reached, and how much `sooner` the first reached
        them, s, with `low` and `high`, a 95 % interval over episodes.
    """
    rows = []
    for system, rows_of_system in table.groupby("system", sort=False):
        groups = list(rows_of_system.groupby(DRIVER[1:], sort=False))
        for (key, group), (other_key, other) in itertools.product(groups, groups):
            (_, method, minutes), (_, other_method, other_minutes) = key, other_key
            same_data = minutes == other_minutes
            sidm_and_without = (method, other_method) == COMPARED and same_data
            if method and (sidm_and_without or not other_method):
                columns = _compared(group, other)
                rows.append((system, *key, label(*other_key), *columns))
    pairs = pd.DataFrame(rows, columns=[*DRIVER, *RIVALS])
    return pairs[pairs.episodes > 0].reset_index(drop=True)


def _compared(driver: pd.DataFrame, other: pd.DataFrame) -> tuple:
    """The columns of `rivals` from `episodes` on for a pair of drivers."""
    from scipy.stats import binomtest  # late, as above

    both = driver.merge(other, on="episode").sort_values("episode")
    more = int((both.missed_x < both.missed_y).sum())
    fewer = int((both.missed_x > both.missed_y).sum())
    chance = float(binomtest(more, more + fewer).pvalue) if more + fewer else 1.0
    reached = both[(both.missed_x == 0) & (both.missed_y == 0)]
    times = (reached.seconds_y - reached.seconds_x).to_numpy(float)
    sooner = Interval(np.nan, np.nan, np.nan)
    if len(times):
        sooner = interval(lambda sample: float(sample.mean()), times)
    return len(both), more, fewer, chance, len(times), *sooner


def claims(table: pd.DataFrame) -> pd.DataFrame:
    """Claims that models with SIDM miss fewer goals and reach goals sooner.

    Times are compared at the goals that models with and without SIDM both reach. A seed
    is a pair: the means over its episodes, of all sizes that both sides have driven.
    """
    point = ["system", "novice_minutes", "episode"]
    with_sidm, without = (table[table.method == method] for method in COMPARED)
    both = with_sidm.merge(
        without[[*point, "missed", "seconds"]], on=point, suffixes=("", "_other")
    )
    reached = both[(both.missed == 0) & (both.missed_other == 0)]
    parts = []
    for pairs, quantity, column, unit in (
        (both, "goals missed (share)", "missed", ""),
        (reached, "time to the goals that both reach", "seconds", "s"),
    ):
        other = f"{column}_other"
        means = pairs.groupby(["system", "seed"])[[column, other]].mean().reset_index()
        others = means[["system", "seed", other]].rename(columns={other: column})
        compared = paired_comparison(
            means, others, on=["system"], by=[], value=column, difference=True
        )
        names = []
        for system in compared.system:
            sizes = np.unique(both[both.system == system].novice_minutes)
            minutes = ", ".join(f"{size:g}" for size in sizes)
            names.append(f"{quantity}, with SIDM's models minus without, {minutes} min")
        parts.append(claim_rows(compared, names, "not measured", unit=unit))
    claims = pd.concat(parts).sort_values("system", kind="stable", ignore_index=True)
    return claims[list(COLUMNS)]
