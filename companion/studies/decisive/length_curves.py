"""What an SIDM saves, had all trainings been stopped earlier: along the training."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.style import legend_below, system_label
from companion.statistics.savings import NO_VALUE, DataRatio, data_ratio
from companion.statistics.stopping_rules import (
    RULES,
    apply_rule,
    kept_after,
    stored_curve,
)
from companion.studies.decisive.verdicts import (
    ALONE_SIZES,
    AT,
    END,
    RELEASED,
    loss_ratio,
    losses_by,
    losses_of,
    paired,
    ratio_of_data,
)
from ownrobot.plots import finish, side_by_side, styled
from sidm.systems import PAPER_SYSTEMS

SIZES = (1.0, 5.0, 20.0)  # min at which losses are compared along the training
#: Samples after which all trainings are stopped: 24 values a decade, rounded to two
#: digits (the E24 series), and the longest training.
DECADE = (
    *(10, 11, 12, 13, 15, 16, 18, 20, 22, 24, 27, 30),
    *(33, 36, 39, 43, 47, 51, 56, 62, 68, 75, 82, 91),
)
LENGTHS = (
    *(10_000 * digits for digits in DECADE),
    *(100_000 * digits for digits in DECADE if digits < 80),
    8_000_000,
)
#: Rules that have a point on the curves -> its marker.
MARKED = {"patience": "^", RELEASED: "s", END: "o"}
STYLES: dict[str, dict[str, Any]] = {
    "R": {"color": "#1A1A1A", "linestyle": "-"},
    "T": {"color": "#8C8C8C", "linestyle": "--"},
}
RECIPE_LABELS = {"R": "as released (R)", "T": "tuned (T)", "Q": "quick (Q)"}


def lengths_of(frame: pd.DataFrame) -> list[int]:
    """The LENGTHS, in samples, from the first test of all trainings to the last end."""
    if not len(frame):
        return []
    first, last = frame.test_spacing.max(), frame.max_samples.max()
    return [samples for samples in LENGTHS if first <= samples <= last]


def along_training(frame: pd.DataFrame) -> pd.DataFrame:
    """What an SIDM saves, had all trainings been stopped after n samples or by a rule.

    Returns:
        A row per `recipe` and `system` that have SIDMs, `quantity` ('data' or 'loss'),
        `minutes` of the SIDM, and `rule`. The rule is empty where all trainings were
        stopped after the same number of `samples`; of a rule, `samples` are the median
        over the SIDM's trainings. `value`, `low`, `high` and `bound` are the data ratio
        at AT minutes, or the ratio of the losses with and without SIDM, from so many
        `seeds`.
    """
    rows: list[tuple] = []
    for (recipe, system), group in frame.groupby(["recipe", "system"], sort=False):
        if not (group.method == "sidm").any():
            continue
        stopped = [
            (samples, "", losses)
            for samples, losses in losses_after(group, lengths_of(group)).items()
        ]
        sidm = group[(group.method == "sidm") & (group.novice_minutes == AT)]
        for name, rule in RULES.items():
            kept = apply_rule(sidm, rule)
            if len(kept):
                samples = int(kept.seen.median())
                stopped.append((samples, name, losses_by(group, name)))
        for samples, name, losses in stopped:
            seeds, saved = ratio_of_data(losses, "sidm")
            rows.append((recipe, system, "data", AT, name, samples, seeds, *saved))
            for size in SIZES:
                ratio = loss_ratio(losses, size)
                rows.append((recipe, system, "loss", size, name, samples, *ratio, ""))
    columns = ["recipe", "system", "quantity", "minutes", "rule", "samples", "seeds"]
    return pd.DataFrame(rows, columns=[*columns, "value", "low", "high", "bound"])


def texts_by_rule(table: pd.DataFrame) -> pd.DataFrame:
    """Data ratios of `along_training` as texts: a row a rule, a column an arm.

    An arm without any ratio is left out.
    """
    shown = table[table.rule.ne("") & table.quantity.eq("data")]
    arms = {
        f"{system_label(system)}, {recipe}": {
            row.rule: DataRatio(row.value, row.low, row.high, row.bound).text(2)
            for row in rows.itertuples()
        }
        for (system, recipe), rows in shown.groupby(["system", "recipe"])
    }
    some = {
        name: texts for name, texts in arms.items() if {*texts.values()} != {NO_VALUE}
    }
    return pd.DataFrame(some).rename_axis("stopped by").reset_index()


def losses_after(
    frame: pd.DataFrame, lengths: Sequence[int]
) -> dict[int, pd.DataFrame]:
    """The validation `loss` that trainings of so many samples keep, by their length.

    The loss is on the validation motion that every test during training has. Each table
    has a row per training with its `method`, `novice_minutes`, `seed` and `loss`.
    """
    whole = frame[frame.test_spacing > 0]
    points = whole[["method", "novice_minutes", "seed"]]
    curves = [stored_curve(row) for _, row in whole.iterrows()]
    kept = [  # a list of losses per training
        [curve.validation_loss[test] for test in kept_after(curve, lengths)]
        for curve in curves
    ]
    return {
        samples: points.assign(loss=[losses[at] for losses in kept])
        for at, samples in enumerate(lengths)
    }


def ratio_at_best(
    frame: pd.DataFrame, system: str, sizes: tuple[float, ...] = (60.0, 120.0)
) -> DataRatio:
    """How much R's data ratio at AT minutes owes to our cap on the rival's training.

    Training alone with 20 minutes of novice data or more reached the cap before the
    released rule ended it: a longer training may have a lower loss, and lower the
    ratio. Here every seed has the loss of the best seed at `sizes` of training alone.
    """
    losses = losses_of(frame, "R", system, RELEASED)
    sidm, alone = paired(losses, "sidm", AT, ALONE_SIZES)
    if len(sidm):
        at = np.isin(ALONE_SIZES, sizes)
        alone = np.where(at, alone.min(0), alone)
    return data_ratio(ALONE_SIZES, alone, sidm, AT)


@styled
def figure(table: pd.DataFrame, systems: Sequence[str] = PAPER_SYSTEMS) -> Figure:
    """Data ratio and loss ratio at AT minutes against samples seen in training.

    A row of panels per system, a curve per recipe; shades are 95 % intervals, and the
    points are what stopping rules give.
    """
    figure, panels = side_by_side(2 * len(systems), 2)
    ylabels = {
        "data": "data without / with SIDM",
        "loss": "loss with / without SIDM",
    }
    shown = [(system, quantity) for system in systems for quantity in ylabels]
    for axes, (system, quantity) in zip(panels, shown, strict=True):
        axes.set(
            xscale="log",
            yscale="log",
            xlabel="samples seen by each",
            ylabel=ylabels[quantity],
        )
        axes.set_title(f"{system_label(system)}, {AT:g} min")
        rows = table[(table.system == system) & (table.quantity == quantity)]
        rows = rows[rows.minutes == AT]
        for recipe, ratios in rows.groupby("recipe", sort=False):
            _draw(axes, ratios, str(recipe))
        axes.axhline(1, color="0.5", lw=1, linestyle="-", marker="", zorder=0)
        finish(axes, legend=False)
    legend_below(figure, panels)
    return figure


def _draw(axes: Axes, ratios: pd.DataFrame, recipe: str) -> None:
    """Draw the curve of a recipe, its interval and the points of stopping rules."""
    style = STYLES[recipe]
    curve = ratios[ratios.rule == ""].sort_values("samples")
    label = RECIPE_LABELS[recipe]
    axes.plot(curve.samples, curve.value, **style, marker="", label=label)
    high = curve.high.replace(np.inf, np.nan)
    shade = {"color": style["color"], "alpha": 0.15, "lw": 0}
    axes.fill_between(curve.samples, curve.low, high, **shade)
    for point in ratios[ratios.rule.isin(list(MARKED))].itertuples():
        reach = np.abs([[point.value - point.low], [point.high - point.value]])
        axes.errorbar(
            [point.samples],
            [point.value],
            yerr=reach if np.isfinite(reach).all() else None,
            color=style["color"],
            linestyle="",
            marker=MARKED[point.rule],
            capsize=2,
            label=f"{recipe}: {'' if point.rule == END else 'rule '}{point.rule}",
        )
