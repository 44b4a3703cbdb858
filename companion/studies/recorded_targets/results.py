"""What recorded targets needed: losses, comparisons and a figure from the records of `measure`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.style import (
    LOSS_BY_SIZE,
    METHOD_STYLES,
    by_system,
    legend_below,
    mean_and_range,
)
from companion.statistics import savings
from companion.statistics.claims import beside_one, judged
from companion.statistics.intervals import Interval
from companion.statistics.pairs import complete, together
from companion.studies.recorded_targets.measure import METHODS_HERE, Proxy
from sidm.plots import finish, styled
from sidm.systems import SYSTEMS

Way = tuple[str, Proxy]  # a method and whose simulation it learns from

#: What the figure draws; the table has the others, too.
SHOWN = tuple(
    one for one in METHODS_HERE if one[0] not in ("corrected", "least_squares")
)
PROXY_WORDS = {
    "none": "",
    "expert": " (simulated expert)",
    "novice": " (simulated novice)",
}
WITHOUT: Way = ("novice_only", "none")  # what the SIDM is held against
BY = ["method", "proxy"]


def label(method: str, proxy: Proxy) -> str:
    """For figures and tables."""
    return METHOD_STYLES[method]["label"] + PROXY_WORDS[proxy]


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """A line a system, method, proxy, seed and size of the recorded data, min, 0 where a model has none.

    Its validation `loss`, the mean position `error` after 2.5 s, m, and the losses (N,)
    of the `pieces` that judge.
    """
    values = ["minutes", "validation_loss", "position_error", "piece_losses"]
    long = frame[["system", *BY, "seed", *values]].explode(values)
    long = long.assign(
        novice_minutes=long.minutes.astype(float),
        loss=long.validation_loss.astype(float),
        error=long.position_error.str[-1].astype(float),
        pieces=long.piece_losses,
    )
    return long.drop(columns=values).reset_index(drop=True)


def _of(table: pd.DataFrame, way: Way) -> pd.DataFrame:
    """A way's lines with recorded data."""
    return table[
        (table.method == way[0]) & (table.proxy == way[1]) & (table.novice_minutes > 0)
    ]


def best_alone(table: pd.DataFrame, system: str) -> Way | None:
    """Which method does best on the recordings alone, by the mean of the loss's logarithm over sizes and seeds.

    Of those that have the most seeds; None where nothing is stored.
    """
    alone = table[(table.system == system) & (table.proxy == "none")]
    groups = alone.assign(log=np.log(alone.loss)).groupby(BY)
    found = groups.agg(seeds=("seed", "nunique"), log=("log", "mean"))
    found = found[found.seeds == found.seeds.max()]
    return found.log.idxmin() if len(found) else None


def compare(table: pd.DataFrame, other: Way) -> pd.DataFrame:
    """All other ways with recorded data beside one, the sizes together: `pairs.together` with a `verdict`."""
    rest = table[
        ((table.method != other[0]) | (table.proxy != other[1]))
        & (table.novice_minutes > 0)
    ]
    found = together(rest, _of(table, other), by=BY, value="loss")
    return found.assign(verdict=beside_one(found))


def by_size(table: pd.DataFrame, other: Way) -> pd.DataFrame:
    """A line a system, way and size: means, and how the way stands beside another.

    `seeds`, mean `loss` and `error`; the `ratio` of the losses with `low` and `high`,
    paired by seed, NaN of that other itself; `saved`, `saved_low`, `saved_high` and
    `bound`: how many times the recorded data the other would need; and `worth`, of a
    model without recorded data, the minutes with which the other does as well.
    """
    point = ["system", *BY, "novice_minutes"]
    found = (
        table.groupby(point, sort=False)
        .agg(seeds=("seed", "size"), loss=("loss", "mean"), error=("error", "mean"))
        .reset_index()
    )
    rest = table[(table.method != other[0]) | (table.proxy != other[1])]
    found = savings.with_savings(
        found, rest[rest.novice_minutes > 0], _of(table, other), ["system"], BY
    )
    worth = {}
    for key, bare in rest[rest.novice_minutes == 0].groupby(point, sort=False):
        alone = complete(_of(table, other), str(key[0]), [other[0]], "loss")
        if alone.values.size:
            worth[key] = savings.minutes_words(
                alone.minutes, alone.values[:, 0].mean(0), bare.loss.mean()
            )
    return found.assign(
        worth=[
            worth.get(key, "")
            for key in found[point].itertuples(index=False, name=None)
        ]
    )


def written(lines: pd.DataFrame) -> pd.DataFrame:
    """The table of `by_size` for a page, ratios and savings with their intervals as texts."""
    labels = [label(*way) for way in lines[BY].itertuples(index=False)]
    ratios = [
        Interval(*ends).words(3)
        for ends in lines[["ratio", "low", "high"]].itertuples(index=False)
    ]
    known = {"saved": "ratio", "saved_low": "low", "saved_high": "high"}
    saved = savings.written(
        lines[["bound", *known]].rename(columns=known).fillna({"bound": "="})
    )
    times = [
        one if isinstance(bound, str) else worth or "-"
        for one, bound, worth in zip(saved, lines.bound, lines.worth, strict=True)
    ]
    return pd.DataFrame(
        {
            "system": lines.system,
            "method": labels,
            "recorded (min)": lines.novice_minutes,
            "seeds": lines.seeds,
            "loss": lines.loss.map("{:.3f}".format),
            "after 2.5 s (m)": lines.error.map("{:.3f}".format),
            "ratio [95 % interval]": [words.replace("nan", "-") for words in ratios],
            "times the data": times,
        }
    )


def grounds_agree(
    table: pd.DataFrame, one: Way, other: Way, grounds: np.ndarray
) -> tuple[int, int] | None:
    """On how many of the grounds that judge a method has the smaller loss, and of how many; None where it is not run.

    Args:
        table: of one system.
        one: the method.
        other: its comparison; seeds that one of them lacks are left out.
        grounds: (N,) number of the ground of each piece that judges.
    """
    point = ["seed", "novice_minutes"]
    both = _of(table, one)[[*point, "pieces"]].merge(
        _of(table, other)[[*point, "pieces"]], on=point
    )
    if not len(both):
        return None
    # (S M, N)
    own, theirs = (np.array(both[f"pieces_{side}"].tolist()) for side in "xy")
    ratios = [
        np.log(
            own[:, grounds == ground].mean(-1) / theirs[:, grounds == ground].mean(-1)
        ).mean()
        for ground in np.unique(grounds)
    ]
    return sum(ratio < 0 for ratio in ratios), len(ratios)


def claims(table: pd.DataFrame) -> pd.DataFrame:
    """The paper's hope (section 6): a smaller loss with an SIDM than without, on the same recordings."""
    found = compare(table[table.method.isin(["sidm", WITHOUT[0]])], WITHOUT)
    found = found[found.method == "sidm"].sort_values(
        ["system", "proxy"], kind="stable"
    )
    sizes = [", ".join(f"{minutes:g}" for minutes in some) for some in found.sizes]
    words = [
        f"loss with SIDM / without, recorded novice, simulated {proxy}, {some} min"
        for proxy, some in zip(found.proxy, sizes, strict=True)
    ]
    return judged(found, words, "less data needed (section 6)")


@styled
def figure(table: pd.DataFrame, systems: Sequence[str] = tuple(SYSTEMS)) -> Figure:
    """Loss against minutes of recorded data, by method and proxy; level lines are of models that saw none."""
    axis = LOSS_BY_SIZE | {"xlabel": "recorded data (min)"}
    figure, plots = by_system(table, systems, "recorded novice of {}", **axis)
    for axes, mine in plots:
        for way in SHOWN:
            _draw(axes, mine, way)
        finish(axes, mine.novice_minutes[mine.novice_minutes > 0], legend=False)
    legend_below(figure, figure.axes)
    return figure


def _draw(axes: Axes, mine: pd.DataFrame, way: Way) -> None:
    """A curve, its shade from minimum to maximum, and for fine-tuning the level where it begins without data."""
    method, proxy = way
    style: dict[str, Any] = METHOD_STYLES[method] | {"label": label(method, proxy)}
    if proxy == "novice":
        style |= {"mfc": "white", "linewidth": 1}
    losses = _of(mine, way).groupby("novice_minutes").loss.agg(["mean", "min", "max"])
    if not len(losses):
        return
    mean_and_range(axes, losses, **style)
    bare = mine[
        (mine.method == method) & (mine.proxy == proxy) & (mine.novice_minutes == 0)
    ].loss
    if len(bare) and method == "pretrain_finetune":
        plain = style | {
            "label": f"the same, no recorded data{PROXY_WORDS[proxy]}",
            "marker": "",
        }
        axes.axhline(bare.mean(), **plain, alpha=0.5)
