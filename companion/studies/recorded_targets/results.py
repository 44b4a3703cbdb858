"""Recorded targets: losses, comparisons, claims and a figure from stored records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.figures.style import (
    LOSS_BY_SIZE,
    METHOD_LABELS,
    METHOD_STYLES,
    legend_below,
    mean_and_range,
    system_panels,
)
from companion.statistics import pairs, savings
from companion.statistics.claims import claim_rows, ratio_verdicts
from companion.statistics.pairs import complete, pooled_comparison
from companion.studies.recorded_targets.measure import HELD_OUT, Proxy
from companion.studies.recorded_targets.recorded import validation_grounds
from ownrobot.plots import finish, styled
from sidm.systems import PAPER_SYSTEMS

Way = tuple[str, Proxy]  # a method and the simulated robot that is its expert

WITHOUT: Way = ("novice_only", "none")  # the way that the SIDM is compared with
#: Ways that the figure draws; the tables have the others, too.
SHOWN: tuple[Way, ...] = (
    WITHOUT,
    ("sidm", "expert"),
    ("least_squares_mirrored", "none"),
    ("pretrain_finetune", "expert"),
    ("corrected_averaged", "expert"),
    ("corrected_averaged", "novice"),
)
PROXY_WORDS = {
    "none": "",
    "expert": " (simulated expert)",
    "novice": " (simulated novice)",
}
#: Columns that identify a way.
BY = ["method", "proxy"]


def label(method: str, proxy: Proxy) -> str:
    """The name of a way in figures and tables."""
    return METHOD_LABELS[method] + PROXY_WORDS[proxy]


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """A row per model.

    There are `system`, `method`, `proxy`, `seed`, `novice_minutes` of recorded data, 0
    where a model has none, the validation `loss`, the mean position `error` after 2.5
    s, m, and the losses (N,) of the validation windows, `pieces`.
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


def _is(table: pd.DataFrame, way: Way) -> pd.Series:
    return (table.method == way[0]) & (table.proxy == way[1])


def _recorded(table: pd.DataFrame) -> pd.DataFrame:
    return table[table.novice_minutes > 0]


def best_alone(table: pd.DataFrame, system: str) -> Way | None:
    """The way with the least loss on a system's recordings alone.

    It has the least mean of the loss's logarithm over sizes and seeds, among the ways
    with the most seeds. None where nothing is stored.
    """
    alone = table[(table.system == system) & (table.proxy == "none")]
    groups = alone.assign(log=np.log(alone.loss)).groupby(BY)
    means = groups.agg(seeds=("seed", "nunique"), log=("log", "mean"))
    means = means[means.seeds == means.seeds.max()]
    return means.log.idxmin() if len(means) else None


def compare(table: pd.DataFrame, other: Way) -> pd.DataFrame:
    """All ways with recorded data compared with one of them, all sizes together."""
    recorded = _recorded(table)
    is_other = _is(recorded, other)
    compared = pooled_comparison(
        recorded[~is_other], recorded[is_other], by=BY, value="loss"
    )
    return compared.assign(verdict=ratio_verdicts(compared))


def beside_best(table: pd.DataFrame, best: Mapping[str, Way]) -> pd.DataFrame:
    """What learns from a simulation beside the best without one, for a page.

    `best` has, by system, the way to compare with, see `best_alone`.
    """
    parts = [
        compare(table[table.system == system], way).assign(beside=label(*way))
        for system, way in best.items()
    ]
    rows = pd.concat(parts)
    rows = rows[rows.proxy != "none"]
    rows = rows.assign(method=[label(*way) for way in rows[BY].to_numpy()])
    columns = ["system", "method", "beside", "seeds", "ratio (95 % interval)"]
    return pairs.page_table(rows)[[*columns, "verdict"]]


def by_size(table: pd.DataFrame, other: Way) -> pd.DataFrame:
    """Means over seeds, compared with another way.

    A row per system, way and size: `seeds`, mean `loss` and `error`; the `ratio` of the
    losses with `low` and `high`, paired by seed, NaN for the other way itself; `saved`,
    `saved_low`, `saved_high` and `bound`: how many times the recorded data the other
    way needs; and `worth`, for a model without recorded data, the minutes with which
    the other way does as well.
    """
    point = ["system", *BY, "novice_minutes"]
    groups = table.groupby(point, sort=False)
    means = groups[["loss", "error"]].mean()
    means.insert(0, "seeds", groups.size())
    is_other = _is(table, other)
    others, rest = _recorded(table[is_other]), table[~is_other]
    means = savings.with_savings(
        means.reset_index(), _recorded(rest), others, ["system"], BY
    )
    worth = {}
    without_data = rest[rest.novice_minutes == 0]
    for key, group in without_data.groupby(point, sort=False):
        losses = complete(others[others.system == key[0]], "loss")
        if losses.values.size:
            curve, loss = losses.values.mean(0), group.loss.mean()
            worth[key] = savings.minutes_text(losses.minutes, curve, loss)
    keys = means[point].itertuples(index=False, name=None)
    return means.assign(worth=[worth.get(key, "") for key in keys])


def of_simulation(lines: pd.DataFrame, minutes: float) -> Any:
    """The line of `by_size` with the least loss of the simulated novice's model.

    With `minutes` of recorded data, least squares correct the model; 0: the model as it
    is. `lines` are of one system; without results there is None.
    """
    corrected = lines.method.isin(["corrected", "corrected_averaged"])
    rows = lines[corrected & (lines.proxy == "novice")]
    rows = rows[rows.novice_minutes == minutes]
    return rows.loc[rows.loss.idxmin()] if len(rows) else None


def page_table(rows: pd.DataFrame) -> pd.DataFrame:
    """The table of `by_size` for a page: ratios and savings with intervals, as text."""
    columns = {
        "system": rows.system,
        "method": [label(*way) for way in rows[BY].itertuples(index=False)],
        "recorded (min)": rows.novice_minutes,
        "seeds": rows.seeds,
        "loss": rows.loss.map("{:.3f}".format),
        "after 2.5 s (m)": rows.error.map("{:.3f}".format),
    }
    page = pd.DataFrame(columns).join(savings.with_savings_texts(rows))
    times, worth = page["times the data"], rows.worth.replace("", "-")
    return page.assign(**{"times the data": times.where(times != "-", worth)})


def agreement(
    table: pd.DataFrame, system: str, proxy: Proxy, recordings: str | Path
) -> str:
    """On how many validation grounds an SIDM has the smaller loss, as text.

    Seeds that lack the results with or without SIDM are left out. The recordings are
    read only if there are results.
    """
    point, rows = ["seed", "novice_minutes"], _recorded(table[table.system == system])
    sidm, without = (
        rows[_is(rows, way)][[*point, "pieces"]] for way in (("sidm", proxy), WITHOUT)
    )
    both = sidm.merge(without, on=point)
    if not len(both):
        return "not run"
    # (S M, N) each: S seeds, M sizes, N windows
    losses, others = (np.array(both[f"pieces_{side}"].tolist()) for side in "xy")
    grounds = validation_grounds(system, HELD_OUT, recordings)  # (N,)
    ratios = []  # mean logarithm of the loss ratio, by ground
    for ground in np.unique(grounds):
        here = grounds == ground
        ratio = losses[:, here].mean(-1) / others[:, here].mean(-1)
        ratios.append(np.log(ratio).mean())
    fewer = sum(ratio < 0 for ratio in ratios)
    return f"a smaller loss with SIDM on {fewer} of {len(ratios)} terrains"


def claims(table: pd.DataFrame) -> pd.DataFrame:
    """The paper's hope (section 6): a smaller loss with an SIDM on the same recordings.

    There is a claim per system and proxy, compared with the same network without SIDM.
    """
    sidm = _sidm_beside_without(table)
    sidm = sidm.sort_values(["system", "proxy"], kind="stable")
    names = []
    for proxy, sizes in zip(sidm.proxy, sidm.sizes, strict=True):
        minutes = ", ".join(f"{size:g}" for size in sizes)
        names.append(
            "loss with SIDM / without, recorded novice, "
            f"simulated {proxy}, {minutes} min"
        )
    return claim_rows(sidm, names, "planned (section 6)")


def sidm_ratios(table: pd.DataFrame) -> dict[str, str]:
    """System -> the loss with an SIDM by that without it, over all sizes, as text.

    The SIDM has the simulated expert.
    """
    rows = _sidm_beside_without(table)
    rows = rows[rows.proxy == "expert"]
    texts = pairs.interval_texts(rows[["ratio", "low", "high"]], 2)
    return dict(zip(rows.system, texts, strict=True))


def _sidm_beside_without(table: pd.DataFrame) -> pd.DataFrame:
    """`compare` for the SIDM with each proxy and the same network without SIDM."""
    return compare(table[table.method.isin(["sidm", WITHOUT[0]])], WITHOUT)


@styled
def figure(table: pd.DataFrame, systems: Sequence[str] = PAPER_SYSTEMS) -> Figure:
    """Loss against minutes of recorded data, a curve per method and proxy.

    Shades reach from minimum to maximum. Level lines are models that learnt from the
    simulated novice alone.
    """
    axis = LOSS_BY_SIZE | {"xlabel": "recorded data (min)"}
    figure, plots = system_panels(table, systems, "recorded novice of {}", **axis)
    for axes, shown in plots:
        for method, proxy in SHOWN:
            rows = shown[_is(shown, (method, proxy))]
            style: dict[str, Any] = METHOD_STYLES[method]
            style = style | {"label": label(method, proxy)}
            if proxy == "novice":
                style |= {"mfc": "white", "linewidth": 1}
            recorded = _recorded(rows).groupby("novice_minutes").loss
            if not len(recorded):
                continue
            mean_and_range(axes, recorded.agg(["mean", "min", "max"]), **style)
            without_data = rows[rows.novice_minutes == 0].loss
            if len(without_data) and proxy == "novice":
                style |= {"label": "the last, without recorded data", "marker": ""}
                axes.axhline(without_data.mean(), **style)
        finish(axes, _recorded(shown).novice_minutes, legend=False)
    legend_below(figure, figure.axes)
    return figure
