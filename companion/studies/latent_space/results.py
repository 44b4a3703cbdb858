"""What was found of latents: means by method and size, and a picture of each model's."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.figures.curves import size_style
from companion.figures.style import (
    LOSS_LABEL,
    METHOD_STYLES,
    SIZE_STYLES,
    by_system,
    legend_below,
)
from sidm.plots import finish, side_by_side, styled
from sidm.systems import ROLES, SYSTEMS

ALIKE = (
    "linear_accuracy",
    "network_accuracy",
    "raw_accuracy",
    "a_distance",
    "mmd",
    "discriminator_accuracy",
)
#: Losses on the novice's motion, and the parts that it is sent through.
CROSSED = {
    "validation_loss": "novice's\nown parts",
    "expert_encoder_loss": "expert's\nencoder",
    "expert_decoder_loss": "expert's\ndecoder",
    "expert_path_loss": "both of the\nexpert's",
}


def table(frame: pd.DataFrame, measures: Sequence[str] = ALIKE) -> pd.DataFrame:
    """Number of models and means of some measures by system, size and method."""
    groups = frame.astype({name: float for name in measures}).groupby(
        ["system", "novice_minutes", "method"]
    )
    found = groups[list(measures)].mean()
    found.insert(0, "trials", groups.size())
    return found.reset_index()


@styled
def figure(frame: pd.DataFrame) -> Figure:
    """Latents of both systems in the plane of their first two principal components, a plot a model, two in a row."""
    ordered = list(
        frame.sort_values(["system", "novice_minutes", "method"]).itertuples()
    )
    figure, panels = side_by_side(max(len(ordered), 1), min(max(len(ordered), 1), 2))
    if not ordered:
        finish(panels[0])
        return figure
    for axes, one in itertools.zip_longest(panels, ordered):
        if one is None:
            axes.set_axis_off()
            continue
        axes.set(xlabel="first component (-)", ylabel="second component (-)")
        axes.set_title(
            f"{one.system}, {one.novice_minutes:g} min, {METHOD_STYLES[one.method]['label']}"
        )
        for role, style in zip(ROLES, SIZE_STYLES, strict=False):
            points = np.array(getattr(one, f"{role}_picture")).T
            axes.plot(
                *points,
                style["marker"],
                color=style["color"],
                ms=3,
                alpha=0.5,
                label=role,
            )
        finish(axes)
    return figure


@styled
def crossed_figure(
    frame: pd.DataFrame, systems: Sequence[str] = tuple(SYSTEMS)
) -> Figure:
    """The loss on the novice's motion through each system's encoder and decoder: means over seeds, a line a model."""
    figure, plots = by_system(
        table(frame, tuple(CROSSED)), systems, yscale="log", ylabel=LOSS_LABEL
    )
    for axes, mine in plots:
        sizes = sorted(mine.novice_minutes.unique())
        for one in mine.sort_values(["method", "novice_minutes"]).itertuples():
            line, style = (
                size_style(one.method, sizes.index(one.novice_minutes)),
                METHOD_STYLES[one.method],
            )
            look = line | {
                "marker": style["marker"],
                "label": f"{style['label']}, {one.novice_minutes:g} min",
            }
            axes.plot(
                range(len(CROSSED)), [getattr(one, name) for name in CROSSED], **look
            )
        finish(axes, legend=False)
        if len(mine):
            axes.set_xticks(range(len(CROSSED)), list(CROSSED.values()))
    legend_below(figure, figure.axes)
    return figure
