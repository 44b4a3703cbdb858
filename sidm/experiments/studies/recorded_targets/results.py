"""What recorded targets needed: losses, comparisons and a figure from the records of `elsewhere`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sidm.experiments.figures.style import LOSS_LABEL, METHOD_STYLES, finish, legend_below, side_by_side, styled
from sidm.experiments.statistics.claims import BETTER, NO_DIFFERENCE, NO_VERDICT, WORSE, Claim, few, ratio_claim
from sidm.experiments.statistics.intervals import FEWEST_SEEDS, Interval, mean_ratio, ratio_of_means
from sidm.experiments.statistics.savings import Saving, minutes_words, savings_between
from sidm.experiments.studies.recorded_targets.transfer import METHODS_HERE, Proxy, Transferred
from sidm.systems import SYSTEMS

Way = tuple[str, Proxy]  # a method and whose simulation it learns from

#: What the figure draws; the table has the others, too.
SHOWN = tuple(one for one in METHODS_HERE if one[0] not in ("corrected", "least_squares"))
PROXY_WORDS = {"none": "", "expert": " (simulated expert)", "novice": " (simulated novice)"}
ALONE = tuple(one for one in METHODS_HERE if one[1] == "none")  # on the recordings alone
WITHOUT: Way = ("novice_only", "none")  # what the SIDM is held against


def label(method: str, proxy: Proxy) -> str:
    """For figures and tables."""
    return METHOD_STYLES[method]["label"] + PROXY_WORDS[proxy]


class Losses(NamedTuple):
    """Of one system, method and proxy: S seeds, M sizes."""

    seeds: list[int]
    minutes: np.ndarray  # (M,) of recorded data; 0 where there was none
    values: np.ndarray  # (S, M) validation loss
    errors: np.ndarray  # (S, M) m, position after 2.5 s

    def of(self, seeds: Sequence[int]) -> np.ndarray:
        """(S', M') losses of some seeds where there were recorded data."""
        return self.values[[self.seeds.index(seed) for seed in seeds]][:, self.minutes > 0]

    @property
    def sizes(self) -> np.ndarray:
        """(M',) minutes where there were recorded data."""
        return self.minutes[self.minutes > 0]


def gather(found: Sequence[Transferred], system: str, method: str, proxy: Proxy) -> Losses:
    """What is stored of a method and proxy, by seed."""
    mine = [o for o in found if (o.about.system, o.about.method, o.about.proxy) == (system, method, proxy)]
    mine.sort(key=lambda one: one.about.seed)
    minutes = np.array(mine[0].minutes if mine else (), float)
    values = np.array([one.validation_loss for one in mine], float).reshape(len(mine), len(minutes))
    errors = np.array([[path[-1] for path in one.position_error] for one in mine], float).reshape(values.shape)
    return Losses([one.about.seed for one in mine], minutes, values, errors)


def best_alone(found: Sequence[Transferred], system: str) -> Way | None:
    """Which method does best on the recordings alone, by the mean of the loss's logarithm over sizes and seeds.

    Of those that have the most seeds.
    """
    stored = {way: gather(found, system, *way).values for way in ALONE}
    most = max(map(len, stored.values()))
    there = {way: float(np.log(values).mean()) for way, values in stored.items() if values.size and len(values) == most}
    return min(there, key=there.__getitem__) if there else None


class Comparison(NamedTuple):
    """A method beside another, over all sizes of recorded data."""

    seeds: int
    ratio: Interval  # of its loss by the other's: geometric mean over the sizes, paired by seed

    @property
    def words(self) -> str:
        """For a table."""
        if not self.seeds:
            return "not run"
        which = f" ({few(self.seeds)})" if self.seeds < FEWEST_SEEDS else ""
        return f"{self.ratio.words(3)} times the loss{which}"

    @property
    def said(self) -> str:
        """Better or worse where the whole interval is."""
        if self.seeds < FEWEST_SEEDS:
            return NO_VERDICT.lower()
        return {-1: BETTER, 0: NO_DIFFERENCE, 1: WORSE}[self.ratio.side(1)]


def compare(found: Sequence[Transferred], system: str, one: Way, other: Way) -> Comparison:
    """Two methods with the seeds that both have."""
    mine, theirs = (gather(found, system, *way) for way in (one, other))
    common = sorted(set(mine.seeds) & set(theirs.seeds))
    if not common or not np.array_equal(mine.sizes, theirs.sizes):
        return Comparison(0, Interval(np.nan, np.nan, np.nan))
    return Comparison(len(common), mean_ratio(mine.of(common), theirs.of(common)))


def grounds_agree(found: Sequence[Transferred], system: str, one: Way, other: Way, grounds: np.ndarray) -> str:
    """On how many of the grounds that judge a method has the smaller loss, as '5 of 8'; '-' where it is not run.

    Args:
        found: the records.
        system: whose.
        one: the method.
        other: its comparison; seeds that one of them lacks are left out.
        grounds: (N,) number of the ground of each piece that judges.
    """
    losses = []
    for method, proxy in (one, other):
        mine = {
            o.about.seed: [losses for losses, minutes in zip(o.piece_losses, o.minutes, strict=True) if minutes > 0]
            for o in found
            if (o.about.system, o.about.method, o.about.proxy) == (system, method, proxy)
        }
        losses.append(mine)
    common = sorted(losses[0].keys() & losses[1].keys())
    if not common:
        return "-"
    own, theirs = (np.array([side[seed] for seed in common]) for side in losses)  # (S, M, N)
    ratios = [
        np.log(own[..., grounds == ground].mean(-1) / theirs[..., grounds == ground].mean(-1)).mean()
        for ground in np.unique(grounds)
    ]
    return f"{sum(ratio < 0 for ratio in ratios)} of {len(ratios)}"


class Line(NamedTuple):
    """A method at one size of recorded data, beside another."""

    system: str
    method: str
    proxy: Proxy
    minutes: float
    seeds: int
    loss: float
    error: float  # m, mean position error after 2.5 s
    ratio: Interval | None  # of the loss by the other's, paired by seed; None of that itself, and without data
    saving: Saving | None  # how many times the recorded data the other would need; None as there
    worth: str  # of a model without recorded data: the minutes with which the other does as well


def lines(found: Sequence[Transferred], system: str, other: Way | None = None) -> list[Line]:
    """A line a method, proxy and size that is stored, beside another method or else the best on the recordings alone.

    Seeds that the other lacks are left out of its columns.
    """
    best = other or best_alone(found, system)
    alone = gather(found, system, *(best or WITHOUT))
    table = []
    for way in METHODS_HERE:
        own = gather(found, system, *way)
        common = sorted(set(own.seeds) & set(alone.seeds))
        saved: dict[float, Saving] = {}
        if common and way != best:
            every = savings_between(own.sizes, own.of(common), alone.sizes, alone.of(common))
            saved = {saving.minutes: saving for saving in every}
        for size, minutes in enumerate(own.minutes.tolist()):
            ratio = None
            if minutes in saved and minutes in alone.sizes:
                beside = alone.of(common)[:, alone.sizes.tolist().index(minutes)]
                mine = own.of(common)[:, own.sizes.tolist().index(minutes)]
                ratio = ratio_of_means(np.stack([beside, mine], axis=1))
            loss, error = float(own.values[:, size].mean()), float(own.errors[:, size].mean())
            worth = ""
            if minutes == 0 and alone.values.size:
                worth = minutes_words(alone.sizes, alone.of(alone.seeds).mean(0), loss)
            saving = saved.get(minutes)
            table.append(Line(system, *way, minutes, len(own.seeds), loss, error, ratio, saving, worth))
    return table


def hoped(found: Sequence[Transferred], system: str) -> list[Claim]:
    """The paper's hope (section 6) as claims: a smaller loss with an SIDM than without, on the same recordings."""
    table = []
    for proxy in ("expert", "novice"):
        mine, theirs = gather(found, system, "sidm", proxy), gather(found, system, *WITHOUT)
        sizes = f"at {', '.join(f'{m:g}' for m in mine.sizes)} min" if mine.sizes.size else "at all sizes"
        words = f"recorded novice of {system}: a smaller loss with SIDM and the simulated {proxy} than without, {sizes}"
        common = sorted(set(mine.seeds) & set(theirs.seeds))
        table.append(ratio_claim(words, "less data needed", mine.of(common), theirs.of(common)))
    return table


def in_short(found: Sequence[Transferred], system: str) -> str:
    """What came out of a system in a sentence or two, for the first page."""
    best = best_alone(found, system)
    table = lines(found, system)
    sizes = [one for one in table if one.minutes > 0]
    if best is None or not sizes:
        return f"{system}: not run"
    least = min(one.minutes for one in sizes)
    first = min((one for one in sizes if one.minutes == least), key=_judged_loss)
    sidm, proxy = [compare(found, system, ("sidm", whose), WITHOUT) for whose in ("expert", "novice")]
    ways = len({(one.method, one.proxy) for one in sizes})
    said = f"{system}: "
    if sidm.seeds and proxy.seeds:
        said += (
            f"with SIDM {sidm.words} of the same network on the recordings alone, and {proxy.words} where the "
            "simulated novice plays the expert, all sizes together. "
        )
    said += (
        f"Best on the recordings alone is {label(*best)}. As these recordings judge them, of all {ways} ways "
        f"{label(first.method, first.proxy)} has the lowest mean loss at {least:g} min, {first.loss:.3g}"
    )
    said += f" ({few(first.seeds)})" if first.seeds < FEWEST_SEEDS else ""
    if (first.method, first.proxy) != best and first.ratio is not None:
        said += f", {first.ratio.words(3)} times that of the best alone"
    bare = [one for one in table if one.minutes == 0]
    if bare:
        its = min(bare, key=_judged_loss)
        said += (
            f". Without any recorded data a model of the simulated {its.proxy} has a loss of {its.loss:.3g}, for which "
            f"the best alone needs {its.worth}"
        )
    return f"{said}."


def _judged_loss(one: Line) -> tuple[int, float]:
    """By which a line is the best: those with the most seeds come first."""
    return -one.seeds, one.loss


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
    minutes, values = own.sizes, own.values[:, some]
    axes.plot(minutes, values.mean(0), **style)
    axes.fill_between(minutes, values.min(0), values.max(0), color=style["color"], alpha=0.2, lw=0)
    if not some.all() and method == "pretrain_finetune":
        plain = style | {"label": f"the same, no recorded data{PROXY_WORDS[proxy]}", "marker": ""}
        axes.axhline(own.values[:, ~some].mean(), **plain, alpha=0.5)
    return set(minutes.tolist())
