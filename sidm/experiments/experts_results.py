"""What a novice needs when its SIDM learnt from several experts: a table and a figure from the records of `experts`."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from sidm.experiments.claims import NO_VERDICT, Claim, difference_claim
from sidm.experiments.drawing import LOSS_LABEL, SIZE_STYLES, finish, side_by_side, styled
from sidm.experiments.experts import WAYS, Pretrained
from sidm.experiments.savings import Saving, savings_between
from sidm.experiments.statistics import Interval, ratio_of_means

PAPER = "'may lead to a more accurate' one"


class Line(NamedTuple):
    """A number of experts, a way to go on and a size of the novice's data, means over seeds."""

    experts: int
    way: str  # of WAYS
    minutes: float  # of the novice's data
    seeds: int
    loss: float  # validation
    ratio: Interval | None  # to that of the single expert, paired by seed; None for it
    saving: Saving | None  # how many times the novice's data the single expert's SIDM needs; None for it
    samples: float  # seen by the novice until the weights that were kept
    compute_minutes: float  # of the novice's training


def _by_seed(found: Sequence[Pretrained], experts: int) -> dict[int, Pretrained]:
    return {one.about.trial.seed: one for one in found if one.about.experts == experts}


def _values(some: Sequence[Pretrained], name: str, way: int) -> np.ndarray:
    """(S, M) of one way."""
    return np.array([getattr(one, name)[way] for one in some], float)


def needed_lines(found: Sequence[Pretrained]) -> list[Line]:
    """A line a number of experts, way and size, of one system; seeds that one side lacks are left out of the ratios."""
    lines = []
    single = _by_seed(found, 1)
    for count in sorted({one.about.experts for one in found}):
        mine = _by_seed(found, count)
        common, sizes = sorted(mine.keys() & single.keys()), np.array(next(iter(mine.values())).about.sizes)
        for number, way in enumerate(WAYS):
            some = list(mine.values())
            loss, samples, seconds = (
                _values(some, name, number).mean(0) for name in ("validation_loss", "best_samples", "seconds")
            )
            ratios: list[Interval | None] = [None] * len(sizes)
            saved: list[Saving | None] = [None] * len(sizes)
            if count > 1 and common:
                own, other = (_values([side[s] for s in common], "validation_loss", number) for side in (mine, single))
                singles = np.array(single[common[0]].about.sizes)
                saved = list(savings_between(sizes, own, singles, other))
                beside = other[:, [singles.tolist().index(minutes) for minutes in sizes]]
                ratios = [ratio_of_means(np.stack([beside[:, k], own[:, k]], axis=1)) for k in range(len(sizes))]
            for k, minutes in enumerate(sizes.tolist()):
                numbers = float(loss[k]), ratios[k], saved[k], float(samples[k]), float(seconds[k]) / 60
                lines.append(Line(count, way, minutes, len(mine), *numbers))
    return lines


def claims(found: Sequence[Pretrained]) -> list[Claim]:
    """Whether the SIDM of most experts gives a smaller loss than that of one, by way and size of the novice's data."""
    most = max((one.about.experts for one in found), default=0)
    if most < 2:
        return [Claim("a smaller loss with several experts' SIDM than with one's", PAPER, "not run", NO_VERDICT)]
    many, single = _by_seed(found, most), _by_seed(found, 1)
    system, table = found[0].about.trial.system, []
    sizes = next(one.about.sizes for one in found if one.about.experts == most)
    for number, words in enumerate(WAYS.values()):
        for size, minutes in enumerate(sizes):  # which the single expert's begin with
            common = sorted(many.keys() & single.keys())
            losses = [[side[seed].validation_loss[number][size] for side in (many, single)] for seed in common]
            claim = f"{system}: a smaller loss with {most} experts' SIDM than with one's, {words}, at {minutes:g} min"
            table.append(difference_claim(claim, PAPER, np.array(losses).reshape(-1, 2)))
    return table


@styled
def experts_figure(found: Sequence[Pretrained]) -> Figure:
    """Validation loss against the novice's data, a plot for each way to go on, a line for each number of experts."""
    figure, panels = side_by_side(len(WAYS))
    for number, (axes, words) in enumerate(zip(panels, WAYS.values(), strict=True)):
        axes.set(xscale="log", yscale="log", xlabel="novice data (min)", ylabel=LOSS_LABEL, title=words)
        sizes: set[float] = set()
        counts = sorted({one.about.experts for one in found})
        for count, style in zip(counts, itertools.cycle(SIZE_STYLES), strict=False):
            some = list(_by_seed(found, count).values())
            values, minutes = _values(some, "validation_loss", number), some[0].about.sizes
            axes.plot(minutes, values.mean(0), label=f"{count} expert{'s' * (count > 1)}", **style)
            axes.fill_between(minutes, values.min(0), values.max(0), color=style["color"], alpha=0.15, lw=0)
            sizes |= set(minutes)
        finish(axes, sizes)
    return figure
