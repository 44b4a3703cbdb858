"""What a novice needs when its SIDM learnt from several experts: a table and a figure from the records of `experts`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from sidm.experiments.engine.store import Row
from sidm.experiments.figures.style import LOSS_LABEL, METHOD_STYLES, SIZE_STYLES, finish, side_by_side, styled
from sidm.experiments.statistics.claims import NO_VERDICT, Claim, few, ratio_claim
from sidm.experiments.statistics.intervals import FEWEST_SEEDS, Interval, mean_ratio, ratio_of_means
from sidm.experiments.statistics.savings import Saving, savings_between
from sidm.experiments.statistics.tables import gather
from sidm.experiments.studies.several_experts.pretrain import WAYS, Pretrained

PAPER = "'may lead to a more accurate' one"
FASTER = "'may also lead to faster training'"
#: The lines of Figure 3's methods, with no SIDM that was learnt before: unlike the experts'.
BESIDE: dict[str, dict[str, Any]] = {
    "novice_only": {"label": METHOD_STYLES["novice_only"]["label"], "color": "#555555", "linestyle": ":", "marker": ""},
    "sidm": {"label": "with SIDM, all at once", "color": "#555555", "linestyle": "-", "lw": 1, "marker": ""},
}
ALL = list(WAYS).index("all")


class Experts(NamedTuple):
    """Those that an SIDM learnt from."""

    number: int
    paper: bool  # whether the paper's is one of them

    @property
    def label(self) -> str:
        """For figures and tables."""
        single = "the paper's expert" if self.paper else "1 of the family"
        return f"{self.number} experts" if self.number > 1 else single


PAPERS, MEMBERS = Experts(1, True), Experts(1, False)  # the single ones


class Line(NamedTuple):
    """Experts, a way to go on and a size of the novice's data, means over seeds."""

    experts: Experts
    way: str  # of WAYS
    minutes: float  # of the novice's data
    seeds: int
    loss: float  # validation
    ratio: Interval | None  # to that of the paper's expert alone, paired by seed; None for it
    saving: Saving | None  # how many times the novice's data its SIDM needs; None for it
    samples: float  # seen by the novice's training, its patience included
    compute_minutes: float  # of a processor, for the novice's training


def experts_of(one: Pretrained) -> Experts:
    """Whom the SIDM of a record learnt from."""
    return Experts(one.about.experts, one.about.paper)


def as_they_are(one: Pretrained) -> list[float]:
    """Validation loss with the parts of each size's nearest expert, before the novice learnt anything."""
    names = [*(["expert"] if one.about.paper else []), *(f"member{number}" for number in range(len(one.about.roles)))]
    return [losses[names.index(role)] for role, losses in zip(one.nearest, one.before, strict=True)]


def _groups(found: Sequence[Pretrained]) -> list[Experts]:
    """Those that are stored: the single ones first, the paper's before the other."""
    return sorted({experts_of(one) for one in found}, key=lambda some: (some.number, not some.paper))


def _by_seed(found: Sequence[Pretrained], experts: Experts) -> dict[int, Pretrained]:
    return {one.about.trial.seed: one for one in found if experts_of(one) == experts}


def _values(some: Sequence[Pretrained], name: str, way: int) -> np.ndarray:
    """(S, M) of one way."""
    return np.array([getattr(one, name)[way] for one in some], float)


def needed_lines(found: Sequence[Pretrained]) -> list[Line]:
    """A line a number of experts, way and size, of one system; seeds that one side lacks are left out of the ratios."""
    lines = []
    single = _by_seed(found, PAPERS)
    for experts in _groups(found):
        mine = _by_seed(found, experts)
        common, sizes = sorted(mine.keys() & single.keys()), np.array(next(iter(mine.values())).about.sizes)
        for number, way in enumerate(WAYS):
            some = list(mine.values())
            loss, samples, seconds = (
                _values(some, name, number).mean(0) for name in ("validation_loss", "samples", "seconds")
            )
            ratios: list[Interval | None] = [None] * len(sizes)
            saved: list[Saving | None] = [None] * len(sizes)
            if experts != PAPERS and common:
                own, other = (_values([side[s] for s in common], "validation_loss", number) for side in (mine, single))
                singles = np.array(single[common[0]].about.sizes)
                saved = list(savings_between(sizes, own, singles, other))
                beside = other[:, [singles.tolist().index(minutes) for minutes in sizes]]
                ratios = [ratio_of_means(np.stack([beside[:, k], own[:, k]], axis=1)) for k in range(len(sizes))]
            for k, minutes in enumerate(sizes.tolist()):
                numbers = float(loss[k]), ratios[k], saved[k], float(samples[k]), float(seconds[k]) / 60
                lines.append(Line(experts, way, minutes, len(mine), *numbers))
    return lines


def beside_lines(rows: Sequence[Row], system: str) -> list[tuple]:
    """A line of a table for each of Figure 3's methods and size: seeds, means of loss, samples and minutes."""
    lines = []
    for method, look in BESIDE.items():
        mine = [row for row in rows if (row.trial.system, row.trial.method) == (system, method)]
        for minutes in sorted({row.trial.novice_minutes for row in mine}):
            some = [row for row in mine if row.trial.novice_minutes == minutes]
            columns = [(row.outcome.validation_loss, row.outcome.samples, row.provenance.seconds / 60) for row in some]
            loss, samples, taken = np.mean(columns, axis=0)
            lines.append((look["label"], minutes, len(some), f"{loss:.3f}", f"{samples:,.0f}", f"{taken:.1f}"))
    return lines


def claims(found: Sequence[Pretrained], rows: Sequence[Row] = ()) -> list[Claim]:
    """Whether the SIDM of most experts gives a smaller loss than that of one, and the novice a shorter training.

    The loss beside the paper's expert, and beside one of the family, which is as near to the novice as the others are,
    by way, the sizes together; the training of encoder and decoder alone beside that of all together with an SIDM that
    is not learnt before, of which `rows` are.
    """
    most = max((experts_of(one) for one in found), default=PAPERS)
    if most.number < 2:
        return [Claim("a smaller loss with several experts' SIDM than with one's", PAPER, "not run", NO_VERDICT)]
    system, sizes = found[0].about.trial.system, next(one.about.sizes for one in found if experts_of(one) == most)
    every, table = ", ".join(f"{minutes:g}" for minutes in sizes), []
    for number, words in enumerate(WAYS.values()):
        for single in (PAPERS, MEMBERS):
            claim = f"{system}: a smaller loss with {most.label}' SIDM than with that of {single.label}"
            values = _common(found, most, single, "validation_loss", number)
            table.append(ratio_claim(f"{claim}, {words}, at {every} min", PAPER, *values))
    for number, words in enumerate(WAYS.values()):
        if number != ALL:
            claim = f"{system}: a shorter training with {most.label}' SIDM, {words}, than with SIDM as in Figure 3"
            values = _samples(list(_by_seed(found, most).values()), rows, number)
            table.append(ratio_claim(f"{claim}, at {every} min", FASTER, *values, "samples"))
    return table


def in_short(found: Sequence[Pretrained]) -> str:
    """What a novice with the fewest data gets from most experts' SIDM beside the single ones', and how to go on."""
    most = max((experts_of(one) for one in found), default=PAPERS)
    if most.number < 2:
        return "not run"
    sides = {one: _common(found, most, one, "validation_loss", ALL) for one in (PAPERS, MEMBERS)}
    if not all(own.size for own, _ in sides.values()):
        return "not run"
    lines = [line for line in needed_lines(found) if line.experts == most]
    least = min(line.minutes for line in lines)
    loss = {line.way: line.loss for line in lines if line.minutes == least}
    beside = ", and ".join(f"{mean_ratio(*both).words(3)} times that after {one.label}" for one, both in sides.items())
    seeds = min(len(own) for own, _ in sides.values())
    return (
        f"{found[0].about.trial.system}: after an SIDM of {most.label} the loss of a novice that learns on with all "
        f"parts is {beside}, its sizes together{f' ({few(seeds)})' if seeds < FEWEST_SEEDS else ''}. With {least:g} "
        f"min it is {loss['all']:.3g}, learning on with encoder and decoder alone {loss['parts']:.3g}, and with fresh "
        f"ones {loss['fresh_parts']:.3g}."
    )


def _common(
    found: Sequence[Pretrained], one: Experts, other: Experts, name: str, way: int
) -> tuple[np.ndarray, np.ndarray]:
    """(S, M) of either with the seeds that both have, at the sizes M of the first."""
    mine, theirs = _by_seed(found, one), _by_seed(found, other)
    common = sorted(mine.keys() & theirs.keys())
    count = len(next(iter(mine.values())).about.sizes)  # which the others' begin with
    own, beside = (
        np.array([getattr(side[seed], name)[way][:count] for seed in common], float).reshape(len(common), count)
        for side in (mine, theirs)
    )
    return own, beside


def _samples(some: Sequence[Pretrained], rows: Sequence[Row], way: int) -> tuple[np.ndarray, np.ndarray]:
    """(S, M) samples of one way to learn the novice, and of training with SIDM, where a seed has all sizes of both."""
    joint = {
        (row.trial.system, row.trial.seed, row.trial.novice_minutes): row.outcome.samples
        for row in rows
        if row.trial.method == "sidm"
    }
    pairs = []
    for one in some:
        keys = [(one.about.trial.system, one.about.trial.seed, minutes) for minutes in one.about.sizes]
        if all(key in joint for key in keys):
            pairs.append((one.samples[way], [joint[key] for key in keys]))
    return np.array([own for own, _ in pairs], float), np.array([beside for _, beside in pairs], float)


def _style(experts: Experts) -> dict[str, Any]:
    """A line's look, the same whatever else is stored."""
    number = 0 if experts == PAPERS else experts.number.bit_length()  # 1, 2, 4, 8: one after the other
    return SIZE_STYLES[number % len(SIZE_STYLES)]


@styled
def experts_figure(found: Sequence[Pretrained], rows: Sequence[Row] = ()) -> Figure:
    """Validation loss against the novice's data, a plot for each way to go on, a line for each number of experts.

    `rows` of Figure 3's methods on the same sizes make lines for comparison.
    """
    figure, panels = side_by_side(len(WAYS))
    for number, (axes, words) in enumerate(zip(panels, WAYS.values(), strict=True)):
        axes.set(xscale="log", yscale="log", xlabel="novice data (min)", ylabel=LOSS_LABEL, title=words)
        sizes: set[float] = set()
        for experts in _groups(found):
            style = _style(experts)
            some = list(_by_seed(found, experts).values())
            values, minutes = _values(some, "validation_loss", number), some[0].about.sizes
            axes.plot(minutes, values.mean(0), label=experts.label, **style)
            axes.fill_between(minutes, values.min(0), values.max(0), color=style["color"], alpha=0.15, lw=0)
            sizes |= set(minutes)
        for method, look in BESIDE.items():
            beside = gather(rows, found[0].about.trial.system, [method]) if found and rows else None
            if beside is not None and beside.values.size:
                axes.plot(beside.minutes, beside.values[:, 0].mean(0), **look)
        finish(axes, sizes, legend=number == len(WAYS) - 1)  # one for all: it would lie over lines
    return figure
