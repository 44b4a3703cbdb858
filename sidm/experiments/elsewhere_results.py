"""What recorded targets needed: losses, savings and a figure from the records of `elsewhere`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sidm.experiments import tables
from sidm.experiments.claims import Claim, saving_claim
from sidm.experiments.drawing import LOSS_LABEL, METHOD_STYLES, finish, legend_below, side_by_side, styled
from sidm.experiments.elsewhere import METHODS_HERE, Proxy, Transferred
from sidm.experiments.savings import Saving, savings_between
from sidm.experiments.statistics import Interval, ratio_of_means
from sidm.systems import SYSTEMS

#: What the figure draws and the verdict is on; the table has the others, too.
SHOWN = tuple(one for one in METHODS_HERE if one[0] != "corrected")
PROXY_WORDS = {"none": "", "expert": ", expert simulated", "novice": ", novice simulated"}
ALONE: tuple[str, Proxy] = ("novice_only", "none")  # what the others are held against


def label(method: str, proxy: Proxy) -> str:
    """For figures and tables."""
    return METHOD_STYLES[method]["label"] + PROXY_WORDS[proxy]


class Losses(NamedTuple):
    """Of one system, method and proxy: S seeds, M sizes."""

    seeds: list[int]
    minutes: np.ndarray  # (M,) of recorded data; 0 where there was none
    values: np.ndarray  # (S, M) validation loss
    errors: np.ndarray  # (S, M) m, position after 2.5 s


def gather(found: Sequence[Transferred], system: str, method: str, proxy: Proxy) -> Losses:
    """What is stored of a method and proxy, by seed."""
    mine = [o for o in found if (o.about.system, o.about.method, o.about.proxy) == (system, method, proxy)]
    mine.sort(key=lambda one: one.about.seed)
    minutes = np.array(mine[0].minutes if mine else (), float)
    values = np.array([one.validation_loss for one in mine], float).reshape(len(mine), len(minutes))
    errors = np.array([[path[-1] for path in one.position_error] for one in mine], float).reshape(values.shape)
    return Losses([one.about.seed for one in mine], minutes, values, errors)


class Line(NamedTuple):
    """A method at one size of recorded data, beside training without SIDM on the recordings alone."""

    system: str
    method: str
    proxy: Proxy
    minutes: float
    seeds: int
    loss: float
    error: float  # m, mean position error after 2.5 s
    ratio: Interval | None  # of the loss by that of the recordings alone, paired by seed; None without their size
    saving: Saving | None  # how many times the recorded data these would need; None without any


def lines(found: Sequence[Transferred], system: str) -> list[Line]:
    """A line a method, proxy and size that is stored; seeds that the comparison lacks are left out of its columns."""
    alone = gather(found, system, *ALONE)
    table = []
    for method, proxy in METHODS_HERE:
        own = gather(found, system, method, proxy)
        common = sorted(set(own.seeds) & set(alone.seeds))
        mine, theirs = ([side.seeds.index(seed) for seed in common] for side in (own, alone))
        some = own.minutes > 0
        saved = {}
        if common and (method, proxy) != ALONE:
            every = savings_between(own.minutes[some], own.values[mine][:, some], alone.minutes, alone.values[theirs])
            saved = {saving.minutes: saving for saving in every}
        for size, minutes in enumerate(own.minutes.tolist()):
            ratio = None
            if minutes in saved and minutes in alone.minutes:
                beside = alone.values[theirs][:, alone.minutes.tolist().index(minutes)]
                ratio = ratio_of_means(np.stack([beside, own.values[mine, size]], axis=1))
            loss, error = own.values[:, size].mean(), own.errors[:, size].mean()
            of_size = float(loss), float(error), ratio, saved.get(minutes)
            table.append(Line(system, method, proxy, minutes, len(own.seeds), *of_size))
    return table


def needed(found: Sequence[Transferred], system: str) -> list[Claim]:
    """What each method with a simulated expert saves of the recorded data, as claims."""
    alone = gather(found, system, *ALONE)
    claims = []
    for method, proxy in SHOWN:
        if proxy == "none":
            continue
        own = gather(found, system, method, proxy)
        common = sorted(set(own.seeds) & set(alone.seeds))
        mine, theirs = ([side.seeds.index(seed) for seed in common] for side in (own, alone))
        both = [own.values[mine][:, own.minutes > 0], alone.values[theirs]]
        values = np.stack(both, axis=1) if common else np.zeros((0, 2, 0))
        words = f"recorded novice of {system}, {label(method, proxy)}: as good on less data as the recordings alone"
        paper = "less" if method == "sidm" else "-"
        claims.append(saving_claim(words, paper, tables.Losses(alone.minutes, values, np.array(common))))
    return claims


@styled
def elsewhere_figure(found: Sequence[Transferred], systems: Sequence[str] = tuple(SYSTEMS)) -> Figure:
    """Loss against minutes of recorded data, by method and proxy; level lines are of models that saw none."""
    figure, panels = side_by_side(len(systems))
    for axes, system in zip(panels, systems, strict=True):
        axes.set(xscale="log", yscale="log", xlabel="recorded data (min)", ylabel=LOSS_LABEL)
        axes.set_title(f"recorded novice of {system}")
        sizes: set[float] = set()
        for method, proxy in SHOWN:
            sizes |= _draw(axes, gather(found, system, method, proxy), method, proxy)
        finish(axes, sizes, legend=False)
    legend_below(figure, panels)
    return figure


def _draw(axes: Axes, own: Losses, method: str, proxy: Proxy) -> set[float]:
    """A curve, its shade from minimum to maximum, and for fine-tuning the level where it begins without data."""
    if not own.values.size:
        return set()
    style: dict[str, Any] = METHOD_STYLES[method] | {"label": label(method, proxy)}
    if proxy == "novice":
        style |= {"mfc": "white", "linewidth": 1}
    some = own.minutes > 0
    minutes, values = own.minutes[some], own.values[:, some]
    axes.plot(minutes, values.mean(0), **style)
    axes.fill_between(minutes, values.min(0), values.max(0), color=style["color"], alpha=0.2, lw=0)
    if not some.all() and method == "pretrain_finetune":
        plain = style | {"label": f"the same, no recorded data{PROXY_WORDS[proxy]}", "marker": ""}
        axes.axhline(own.values[:, ~some].mean(), **plain, alpha=0.5)
    return set(minutes.tolist())
