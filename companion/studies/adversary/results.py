"""Table and figure of the adversary's strength."""

from __future__ import annotations

from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.style import METHOD_STYLES, system_label
from companion.studies.adversary.measure import (
    NONE,
    REVERSAL_WEIGHTS,
    STRENGTHS,
    Strength,
)
from sidm.plots import finish, side_by_side, styled

#: Classifier -> colour, marker and label of its accuracy.
LINES = {
    "discriminator_accuracy": ("#7A3E9D", "s", "its own discriminator"),
    "network_accuracy": ("#009E73", "o", "a fresh network"),
    "linear_accuracy": ("#E69F00", "^", "a fresh logistic regression"),
}
#: Way of matching -> its strengths as a figure writes them, the weakest first.
STRENGTHS_OF = {
    "adversary": [strength.words for strength in STRENGTHS],
    "reversal": [NONE.words, *(f"{weight:g}" for weight in REVERSAL_WEIGHTS)],
}
#: Way of matching -> what its strength is.
AXIS_LABELS = {
    "adversary": "discriminator / matching iterations a phase",
    "reversal": "weight of the reversed gradient",
}
CHANCE = 0.5


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """Means over seeds: a row per system, way of matching and strength.

    Each way begins with its weakest strength, which is no matching.
    """
    parts = []
    for way, strengths in STRENGTHS_OF.items():
        rows = frame[~frame.training_regularise | (frame.training_matching == way)]
        names = [_strength(row) for row in rows.itertuples()]
        places = [strengths.index(name) for name in names]
        parts.append(rows.assign(way=way, order=places, strength=names))
    means = pd.concat(parts).groupby(["system", "way", "order", "strength"])
    table = means.agg(
        seeds=("seed", "nunique"),
        lowest=("validation_loss", "min"),
        highest=("validation_loss", "max"),
        **{name: (name, "mean") for name in ("validation_loss", "mmd", *LINES)},
    )
    return table.reset_index()


def _strength(row: Any) -> str:
    """A record's strength as STRENGTHS_OF has it."""
    if not row.training_regularise:
        return NONE.words
    if row.training_matching == "reversal":
        return f"{row.training_reversal_weight:g}"
    return Strength(
        row.training_discriminator_iterations, row.training_matching_iterations
    ).words


@styled
def figure(table: pd.DataFrame) -> Figure:
    """Loss and accuracies of classifiers against the strength, a row for each way."""
    groups = list(table.groupby(["way", "system"]))
    drawn, panels = side_by_side(2 * max(len(groups), 1), 2)
    for row, ((way, system), means) in enumerate(groups):
        left, right = panels[2 * row : 2 * row + 2]
        _draw_losses(left, means.reset_index(drop=True))
        _draw_accuracies(right, means.reset_index(drop=True))
        for axes in (left, right):
            axes.set_title(f"{system_label(system)}, 5 min of novice data")
            axes.set_xticks(range(len(means)), means.strength)
            axes.set_xlabel(AXIS_LABELS[way])
            finish(axes, legend=axes is right)
    for axes in panels[2 * len(groups) :]:
        finish(axes)
    losses = panels[::2]
    ends = [end for axes in losses for end in axes.get_ylim()]
    for axes in losses:
        axes.set_ylim(min(ends), max(ends))  # one scale, since one loss
    return drawn


def _draw_losses(axes: Axes, means: pd.DataFrame) -> None:
    """The mean loss of each strength, with a bar from the lowest to the highest."""
    reach = [
        means.validation_loss - means.lowest,
        means.highest - means.validation_loss,
    ]
    colour = METHOD_STYLES["sidm"]["color"]
    dots = {"color": colour, "linestyle": "", "marker": "o", "capsize": 3}
    axes.errorbar(means.index, means.validation_loss, yerr=reach, **dots)
    axes.set(ylabel="validation loss")


def _draw_accuracies(axes: Axes, means: pd.DataFrame) -> None:
    """How often each classifier tells the robots' latents apart, and chance."""
    for name, (colour, marker, label) in LINES.items():
        style: dict[str, Any] = {"color": colour, "linestyle": "", "marker": marker}
        axes.plot(means.index, means[name].astype(float), label=label, **style)
    axes.axhline(CHANCE, color="0.5", linestyle="-", marker="", lw=1)
    axes.set(ylabel="latents told apart by", ylim=(CHANCE - 0.05, 1.02))
