"""Table and figure of the adversary's strength."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.figures.style import system_label
from companion.studies.adversary.measure import NONE, STRENGTHS, Strength
from sidm.plots import finish, side_by_side, styled

#: Classifier -> colour, line, marker and label of its accuracy.
LINES = {
    "discriminator_accuracy": ("#7A3E9D", "--", "s", "its own discriminator"),
    "network_accuracy": ("#009E73", "-", "o", "a fresh network"),
    "linear_accuracy": ("#E69F00", ":", "^", "a fresh logistic regression"),
}


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """Means over seeds: a row per system and strength, from the weakest.

    Args:
        frame: records of the study.
    """
    strengths = [
        Strength(
            row.training_discriminator_iterations, row.training_matching_iterations
        )
        if row.training_regularise
        else NONE
        for row in frame.itertuples()
    ]
    rows = frame.assign(
        order=[STRENGTHS.index(strength) for strength in strengths],
        strength=[strength.words for strength in strengths],
    )
    means = rows.groupby(["system", "order", "strength"])
    table = means.agg(
        seeds=("seed", "nunique"),
        lowest=("validation_loss", "min"),
        highest=("validation_loss", "max"),
        **{name: (name, "mean") for name in ("validation_loss", "mmd", *LINES)},
    )
    return table.reset_index()


@styled
def figure(table: pd.DataFrame) -> Figure:
    """Loss and accuracies of classifiers against the adversary's strength.

    Args:
        table: made by `table`.
    """
    systems = list(dict.fromkeys(table.system))
    drawn, panels = side_by_side(2 * max(len(systems), 1), 2)
    for row, system in enumerate(systems):
        left, right = panels[2 * row : 2 * row + 2]
        means = table[table.system == system].reset_index(drop=True)
        reach = np.abs(
            [
                means.validation_loss - means.lowest,
                means.highest - means.validation_loss,
            ]
        )
        left.errorbar(
            means.index, means.validation_loss, yerr=reach, color="#0072B2", capsize=3
        )
        left.set(ylabel="validation loss")
        for name, (colour, line, marker, label) in LINES.items():
            right.plot(
                means.index,
                means[name].astype(float),
                color=colour,
                linestyle=line,
                marker=marker,
                label=label,
            )
        right.axhline(0.5, color="0.5", linestyle="-", marker="", lw=1)
        right.set(ylabel="latents told apart by", ylim=(0.45, 1.02))
        for axes in (left, right):
            axes.set_title(f"{system_label(system)}, 5 min of novice data")
            axes.set_xticks(means.index, means.strength)
            axes.set_xlabel("discriminator / matching iterations a phase")
            finish(axes, legend=axes is right)
    return drawn
