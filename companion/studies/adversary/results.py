"""Table and figure of the adversary's strength."""

from __future__ import annotations

from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from companion.figures.style import METHOD_STYLES, system_label
from companion.studies.adversary.measure import PHASES, REVERSAL_WEIGHTS
from ownrobot.plots import finish, side_by_side, styled

#: Classifier -> colour, marker and label of its accuracy.
LINES = {
    "discriminator_accuracy": ("#7A3E9D", "s", "its own discriminator"),
    "network_accuracy": ("#009E73", "o", "a fresh network"),
    "linear_accuracy": ("#E69F00", "^", "a fresh logistic regression"),
}
#: Way of matching -> its strengths as a figure writes them, the weakest first.
STRENGTHS = {
    "adversary": ["none", *(f"{one} / {other}" for one, other in PHASES)],
    "reversal": ["none", *(f"{weight:g}" for weight in REVERSAL_WEIGHTS)],
}
#: Way of matching -> what its strength is.
AXIS_LABELS = {
    "adversary": "discriminator / matching iterations",
    "reversal": "weight of the reversed gradient",
}
CHANCE = 0.5


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """Means over seeds: a row per system, way of matching and strength.

    Each way begins with its weakest strength, which is no matching.
    """
    parts = []
    for way, strengths in STRENGTHS.items():
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
    """A record's strength as STRENGTHS has it."""
    if not row.training_regularise:
        return "none"
    if row.training_matching == "reversal":
        return f"{row.training_reversal_weight:g}"
    first, second = "discriminator_iterations", "matching_iterations"
    return " / ".join(str(getattr(row, f"training_{name}")) for name in (first, second))


@styled
def figure(table: pd.DataFrame) -> Figure:
    """Loss and accuracies of classifiers against the strength, a row for each way.

    Dots are mean losses, with a bar from the lowest to the highest. The accuracies say
    how often each classifier tells the robots' latents apart, beside chance.
    """
    groups = list(table.groupby(["way", "system"]))
    drawn, panels = side_by_side(2 * max(len(groups), 1), 2)
    for row, ((way, system), means) in enumerate(groups):
        left, right = panels[2 * row : 2 * row + 2]
        places, loss = range(len(means)), means.validation_loss
        dots: dict[str, Any] = {"color": METHOD_STYLES["sidm"]["color"]}
        dots |= {"linestyle": "", "marker": "o", "capsize": 3}
        left.errorbar(places, loss, [loss - means.lowest, means.highest - loss], **dots)
        left.set(ylabel="validation loss")
        for name, (colour, marker, label) in LINES.items():
            style: dict[str, Any] = {"color": colour, "marker": marker, "label": label}
            right.plot(places, means[name].astype(float), linestyle="", **style)
        right.axhline(CHANCE, color="0.5", linestyle="-", marker="", lw=1)
        right.set(ylabel="latents told apart by", ylim=(CHANCE - 0.05, 1.02))
        for axes in (left, right):
            axes.set_title(f"{system_label(system)}, 5 min of novice data")
            axes.set_xticks(places, means.strength.str.replace("/ ", "/\n"))
            axes.set_xlabel(AXIS_LABELS[way])
            finish(axes, legend=axes is right)
    for axes in panels[2 * len(groups) :]:
        finish(axes)
    losses = panels[::2]
    ends = [end for axes in losses for end in axes.get_ylim()]
    for axes in losses:
        axes.set_ylim(min(ends), max(ends))  # one scale, since one loss
    return drawn
