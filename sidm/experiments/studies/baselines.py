"""The method among its neighbours: what each reaches on the same novice data, and what it costs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sidm.experiments.engine.store import Row
from sidm.experiments.figures.style import (
    METHOD_STYLES,
    SIZE_STYLES,
    finish,
    side_by_side,
    styled,
)
from sidm.experiments.methods import METHODS
from sidm.experiments.statistics.intervals import Interval, interval
from sidm.experiments.studies.throughput import Pace, seconds
from sidm.systems import SYSTEMS

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Neighbour(NamedTuple):
    """A method on one system and size."""

    system: str
    minutes: float  # of novice data
    method: str
    seeds: int
    loss: float  # mean validation loss
    lowest: float
    highest: float
    differences: tuple[Interval | None, ...]  # from each comparison, paired by seed, below zero where the method is
    # better; none from itself, nor where no seed has both
    samples: float  # mean, of prediction and pretraining
    compute_minutes: float  # mean, of a trial, beside whatever ran then
    paced_minutes: float | None  # mean, of the samples at the paces of one measurement; none without it


def neighbours(
    rows: Iterable[Row], against: Sequence[str] = ("sidm", "novice_only"), paces: Mapping[str, Pace] | None = None
) -> list[Neighbour]:
    """A line a system, size and method, in the order of METHODS.

    Args:
        rows: at most one a system, size, method and seed.
        against: methods that the others are compared with.
        paces: seconds of 1,000 samples by method, as `pace.read` finds them.

    Raises:
        ValueError: two different trials stand for the same point.
    """
    groups: dict[tuple[str, float, str], dict[int, Row]] = {}
    for row in rows:
        t = row.trial
        group = groups.setdefault((t.system, t.novice_minutes, t.method), {})
        if group.setdefault(t.seed, row).trial != t:
            raise ValueError(f"two different trials of {t}; give the rows of one grid at a time")
    order = list(METHODS)
    found = []
    for (system, minutes, method), group in sorted(groups.items(), key=lambda i: (*i[0][:2], order.index(i[0][2]))):
        losses = [row.outcome.validation_loss for row in group.values()]
        samples = [row.outcome.samples + row.outcome.pretraining_samples for row in group.values()]
        differences = tuple(
            None if other == method else _difference(group, groups.get((system, minutes, other), {}))
            for other in against
        )
        mean, lowest, highest = float(np.mean(losses)), min(losses), max(losses)
        cost = float(np.mean([row.provenance.seconds for row in group.values()])) / 60
        paced = [spent for row in group.values() if (spent := seconds(row, paces or {})) is not None]
        found.append(
            Neighbour(
                system, minutes, method, len(group), mean, lowest, highest, differences,
                samples=float(np.mean(samples)),
                compute_minutes=cost,
                paced_minutes=float(np.mean(paced)) / 60 if paced else None,
            )
        )  # fmt: skip
    return found


def _difference(group: dict[int, Row], other: dict[int, Row]) -> Interval | None:
    """Of the mean losses of the seeds that both have."""
    seeds = sorted(group.keys() & other.keys())
    if not seeds:
        return None
    pairs = np.array([[side[seed].outcome.validation_loss for side in (group, other)] for seed in seeds])
    return interval(lambda some: float((some[:, 0] - some[:, 1]).mean()), pairs)


@styled
def neighbours_figure(
    found: Sequence[Neighbour], sizes: Sequence[float], systems: Sequence[str] = tuple(SYSTEMS)
) -> Figure:
    """Validation loss of each method, mean with minimum to maximum: a plot a system, a colour a size.

    Args:
        found: as `neighbours` finds them.
        sizes: that the methods are compared at, min; those with other sizes are vertical lines.
        systems: a plot each.
    """
    figure, panels = side_by_side(len(systems))
    methods = [name for name in METHODS if any(one.method == name for one in found)]
    figure.set_size_inches(figure.get_size_inches()[0], 1.2 + 0.34 * max(len(methods), 5))
    for axes, system in zip(panels, systems, strict=True):
        for number, minutes in enumerate(sizes):
            here = [one for one in found if (one.system, one.minutes) == (system, minutes)]
            if here:
                means = np.array([one.loss for one in here])
                ends = np.array([(one.loss - one.lowest, one.highest - one.loss) for one in here]).T.clip(0)
                height = [methods.index(one.method) + 0.16 * (number - (len(sizes) - 1) / 2) for one in here]
                style = SIZE_STYLES[number % len(SIZE_STYLES)] | {"linestyle": ""}
                axes.errorbar(means, height, xerr=ends, capsize=2, label=f"{minutes:g} min", **style)
        for one in found:
            if one.system == system and one.minutes not in sizes:
                label = f"{METHOD_STYLES[one.method]['label']}, {one.minutes:g} min"
                axes.axvline(one.loss, color="0.5", linestyle=":", marker="", label=label)
        axes.set(xlabel="validation loss, equation (1)", title=system, ylim=(len(methods) - 0.5, -0.5))
        finish(axes)
        labels = [METHOD_STYLES[name]["label"] for name in methods] if axes is panels[0] else [""] * len(methods)
        axes.set_yticks(range(len(methods)), labels)
    return figure
