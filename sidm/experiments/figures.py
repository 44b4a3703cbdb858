"""Results as figures, each a matplotlib Figure in the book's style: colour-blind safe, opaque, units on every axis."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sidm.experiments.ablations import ablated, ablation_lines
from sidm.experiments.baselines import Neighbour
from sidm.experiments.drawing import (
    CONTROL_STEP,
    EFFICIENCY_MARKS,
    LOSS_LABEL,
    METHOD_STYLES,
    SIZE_STYLES,
    finish,
    legend_below,
    side_by_side,
    styled,
)
from sidm.experiments.methods import COMPARED, FIGURE3, METHODS
from sidm.experiments.savings import efficiency_band
from sidm.experiments.statistics import efficiency, falling, summarise
from sidm.experiments.store import Row
from sidm.experiments.tables import gather
from sidm.systems import ROLES, SYSTEMS

if TYPE_CHECKING:  # scikit-learn need not be there to draw the others
    from sidm.experiments.diagnostics import Diagnosis

MOST_INSIDE = 4  # methods whose names have room within a plot


@styled
def figure3(rows: Sequence[Row], systems: Sequence[str] = tuple(SYSTEMS), methods: Sequence[str] = FIGURE3) -> Figure:
    """Figure 3: validation loss against novice data; lines are means over seeds, shades minimum to maximum.

    A dotted level marks the method `expert_only` where it is among the rows: it has no novice data. The names of more
    than MOST_INSIDE methods stand below the plots.
    """
    figure, panels = side_by_side(len(systems))
    crowded = len(methods) > MOST_INSIDE
    for axes, system in zip(panels, systems, strict=True):
        drawn = _curves(axes, rows, system, methods)
        alone = gather([row for row in rows if row.trial.method == "expert_only"], system, ["expert_only"]).values
        if alone.size:
            style = METHOD_STYLES["expert_only"] | {"marker": "", "linestyle": ":"}
            axes.axhline(alone.mean(), **style)
            axes.axhspan(alone.min(), alone.max(), color=style["color"], alpha=0.12, lw=0)
        finish(axes, drawn, legend=not crowded)
    if crowded:
        legend_below(figure, panels)
    return figure


def _curves(
    axes: Axes, rows: Sequence[Row], system: str, methods: Sequence[str], words: str = "", **other: Any
) -> set[float]:
    """Figure 3's curves of some methods, and the sizes that they have; `words` after the labels, `other` styles."""
    axes.set(xscale="log", yscale="log", xlabel="novice data (min)", ylabel=LOSS_LABEL, title=system)
    drawn: set[float] = set()
    for method in methods:
        found = gather([row for row in rows if row.trial.method == method], system, [method])
        if found.values.size:
            summary, style = summarise(found.values[:, 0]), METHOD_STYLES[method] | other
            one = ", one seed" if words and len(found.seeds) == 1 else ""
            axes.plot(found.minutes, summary.mean, **style | {"label": style["label"] + words + one})
            shade = {"color": style["color"], "alpha": 0.2, "lw": 0}
            axes.fill_between(found.minutes, summary.minimum, summary.maximum, **shade)
            drawn |= set(found.minutes)
    return drawn


@styled
def changed_choices(
    rows: Sequence[Row], changed: Sequence[Row], words: str, systems: Sequence[str] = tuple(SYSTEMS)
) -> Figure:
    """Figure 3's curves of the paper's methods, beside those with a choice changed with hollow marks and `words`."""
    figure, panels = side_by_side(len(systems))
    for axes, system in zip(panels, systems, strict=True):
        drawn = _curves(axes, rows, system, COMPARED)
        drawn |= _curves(axes, changed, system, COMPARED, words=f", {words}", mfc="white", linewidth=1)
        finish(axes, drawn)
    return figure


@styled
def efficiency_curves(rows: Sequence[Row], systems: Sequence[str] = tuple(SYSTEMS)) -> Figure:
    """Data-efficiency ratio against the loss to be reached, its 95 % interval shaded; triangles mark bounds."""
    figure, panels = side_by_side(len(systems))
    for axes, system in zip(panels, systems, strict=True):
        axes.set(yscale="log", xlabel="validation loss to reach\n(squared m, m/s and rad/s, summed)", title=system)
        axes.set_ylabel("data without SIDM / data with SIDM (-)")
        losses = gather(rows, system)
        if losses.values.size:
            sidm, novice = losses.values.mean(0)
            reach = np.concatenate([falling(sidm), falling(novice)])
            found = efficiency(losses.minutes, sidm, novice, np.linspace(reach.min(), reach.max(), 60))
            band = efficiency_band(losses.minutes, losses.values, found.loss)
            axes.fill_between(found.loss, *band, color="0.5", alpha=0.2, lw=0)
            for bound, marker, colour, words in EFFICIENCY_MARKS:
                at = found.bound == bound
                if at.any():
                    axes.plot(found.loss[at], found.ratio[at], marker, color=colour, label=words)
            axes.axhline(1, color="0.5", lw=1, linestyle="-", marker="")
        finish(axes)
    return figure


def _sized(rows: Sequence[Row]) -> list[tuple[str, float, list[Row]]]:
    """Rows by method and size, both in order."""
    groups: dict[tuple[str, float], list[Row]] = {}
    for row in rows:
        groups.setdefault((row.trial.method, row.trial.novice_minutes), []).append(row)
    return [(method, minutes, group) for (method, minutes), group in sorted(groups.items(), reverse=True)]


def _size_style(method: str, index: int) -> dict[str, Any]:
    """A method's colour, with a line style by the number of the size."""
    line = ("-", "--", "-.", ":", (0, (5, 1, 1, 1)), (0, (1, 3)))[index % 6]
    return {"color": METHOD_STYLES[method]["color"], "linestyle": line, "marker": ""}


@styled
def figure4(rows: Sequence[Row], seed: int = 0) -> Figure:
    """Figure 4: deviation of the predicted from the actual path over time, and one example seen from above.

    Args:
        rows: of one system; lines are means over the trials, shades their standard error.
        seed: whose trials draw the example's paths.
    """
    figure, (left, right) = side_by_side(2)
    left.set(xlabel="time (s)", ylabel="deviation from the actual position (m)", title="mean and standard error")
    right.set(xlabel="x (m)", ylabel="y (m)", title="one example from above")
    sizes = sorted({row.trial.novice_minutes for row in rows})
    for method, minutes, group in _sized(rows):
        style = _size_style(method, sizes.index(minutes))
        label = f"{METHOD_STYLES[method]['label']}, {minutes:g} min"
        errors = np.array([(0.0, *row.outcome.position_error) for row in group])  # (S, K + 1)
        time, mean = CONTROL_STEP * np.arange(errors.shape[1]), errors.mean(0)
        left.plot(time, mean, label=label, **style)
        if len(errors) > 1:
            spread = errors.std(0, ddof=1) / np.sqrt(len(errors))
            left.fill_between(time, mean - spread, mean + spread, color=style["color"], alpha=0.15, lw=0)
        for row in group:
            if row.trial.seed == seed:
                right.plot(*np.array(row.outcome.example_predicted).T, **style)  # lines as on the left
    shown = [row for row in rows if row.trial.seed == seed]
    if shown:
        right.plot(
            *np.array(shown[0].outcome.example_actual).T, color="black", linestyle="-", marker="", label="actual"
        )
        right.set_aspect("equal", adjustable="datalim")
    finish(left)
    finish(right)
    return figure


@styled
def learning_curves(rows: Sequence[Row], systems: Sequence[str] = tuple(SYSTEMS)) -> Figure:
    """Novice test loss against samples seen, a thin line a trial."""
    figure, panels = side_by_side(len(systems))
    for axes, system in zip(panels, systems, strict=True):
        axes.set(xscale="log", yscale="log", xlabel="samples seen (control steps)", title=system)
        axes.set_ylabel("novice test loss, equation (1)\n(raw units squared)")
        here = [row for row in rows if row.trial.system == system]
        sizes = sorted({row.trial.novice_minutes for row in here})
        for method, minutes, group in _sized(here):
            style = _size_style(method, sizes.index(minutes))
            for number, row in enumerate(group):
                label = f"{METHOD_STYLES[method]['label']}, {minutes:g} min" if number == 0 else None
                axes.plot(row.outcome.curve_samples, row.outcome.curve_test_loss, lw=0.9, label=label, **style)
        finish(axes, legend=False)
    drawn = dict(zip(*reversed(_legend_entries(panels)), strict=True))
    if drawn:
        figure.legend(drawn.values(), drawn.keys(), loc="outside right upper")
    return figure


def _legend_entries(panels: Sequence[Axes]) -> tuple[list[Any], list[str]]:
    """Handles and labels of all plots together."""
    pairs = [axes.get_legend_handles_labels() for axes in panels]
    return [h for handles, _ in pairs for h in handles], [label for _, labels in pairs for label in labels]


@styled
def latent_pictures(found: Sequence[Diagnosis]) -> Figure:
    """Latents of both systems in the plane of their first two principal components, a plot a diagnosis."""
    ordered = sorted(found, key=lambda one: (one.trial.system, one.trial.novice_minutes, one.trial.method))
    figure, panels = side_by_side(max(len(found), 1), min(max(len(found), 1), 4))
    if not ordered:
        finish(panels[0])
        return figure
    for axes, one in itertools.zip_longest(panels, ordered):
        if one is None:
            axes.set_axis_off()
            continue
        trial = one.trial
        axes.set(xlabel="first component (-)", ylabel="second component (-)")
        axes.set_title(f"{trial.system}, {trial.novice_minutes:g} min\n{METHOD_STYLES[trial.method]['label']}")
        for role, style in zip(ROLES, SIZE_STYLES, strict=False):
            points = np.array(getattr(one, f"{role}_picture")).T
            axes.plot(*points, style["marker"], color=style["color"], ms=3, alpha=0.5, label=role)
        finish(axes)
    return figure


#: What the values of an ablation count; those of the phases are iterations a phase.
_COUNTED = {"p_expert": "probability", "pixels": "a side of the map", "patience": "samples"}


@styled
def ablation(
    rows: Sequence[Row],
    name: str,
    systems: Sequence[str] = tuple(SYSTEMS),
    by_method: bool = False,
    usual: Mapping[str, float] = MappingProxyType({}),
) -> Figure:
    """Validation loss against an ablated value: mean over seeds with minimum to maximum.

    A probability has an axis of its own; of other values each that was tried has a place, in their order.

    Args:
        rows: the ablation's.
        name: of the value, as `ablated` takes it.
        systems: a plot each.
        by_method: whether each method has a line for each size; else all of a size are one line.
        usual: each system's value in Figure 3, which a vertical line marks.
    """
    figure, panels = side_by_side(len(systems))
    tried = sorted({ablated(row.trial, name) for row in rows} | set(usual.values()))
    place = {value: value if name == "p_expert" else float(number) for number, value in enumerate(tried)}
    for axes, system in zip(panels, systems, strict=True):
        unit = _COUNTED.get(name, "a phase")
        axes.set(xlabel=f"{name.replace('_', ' ')} ({unit})", ylabel=LOSS_LABEL, title=system)
        lines = ablation_lines([row for row in rows if row.trial.system == system], name, by_method)
        for number, ((_, minutes, method), found) in enumerate(sorted(lines.items())):
            style = SIZE_STYLES[number % len(SIZE_STYLES)]
            values = sorted(found)
            means = np.array([np.mean(found[v]) for v in values])
            lowest, highest = (np.array([end(found[v]) for v in values]) for end in (min, max))
            spread = np.clip([means - lowest, highest - means], 0, None)
            words = f"{METHOD_STYLES[method]['label']}, {minutes:g} min" if method else f"{minutes:g} min"
            axes.errorbar([place[value] for value in values], means, spread, capsize=3, label=words, **style)
        if lines and system in usual:
            axes.axvline(place[usual[system]], color="0.6", linestyle=":", marker="", zorder=0, label="as in Figure 3")
        finish(axes)
        if lines and name == "p_expert":
            axes.set_xlim(-0.03, 1.03)
        elif lines:
            axes.set_xticks(list(place.values()), [f"{value:,.0f}" for value in place])
            axes.set_xlim(-0.3, len(place) - 0.7)
    return figure


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
