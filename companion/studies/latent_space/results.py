"""Tables and figures of latents: means by method and size, and a picture per model."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.figures.dots import HOLLOW, dot_plots, name_rows
from companion.figures.style import (
    METHOD_LABELS,
    METHOD_STYLES,
    ROLE_STYLES,
    legend_below,
    system_label,
)
from companion.statistics.pairs import paired_comparison
from ownrobot.plots import finish, side_by_side, styled
from sidm.systems import PAPER_SYSTEMS, ROLES

#: Measures of how alike the latents are -> their headings on a page.
ALIKE = {
    "linear_accuracy": "linear",
    "network_accuracy": "network",
    "raw_accuracy": "raw",
    "a_distance": "A-distance",
    "mmd": "MMD",
    "discriminator_accuracy": "own",
}
#: Columns of the tables -> their headings on a page.
HEADINGS = ALIKE | {
    "novice_minutes": "novice data (min)",
    "validation_loss": "own parts",
    "expert_encoder_loss": "expert's encoder",
    "expert_decoder_loss": "expert's decoder",
    "expert_path_loss": "both",
}
#: Losses on the novice's motion -> the parts of the model that they are computed with.
CROSSED = {
    "validation_loss": "the novice's own parts",
    "expert_encoder_loss": "the expert's encoder",
    "expert_decoder_loss": "the expert's decoder",
    "expert_path_loss": "both of the expert's",
}


def table(frame: pd.DataFrame, measures: Iterable[str] = ALIKE) -> pd.DataFrame:
    """Number of models and means of measures: a row per system, size and method."""
    groups = frame.astype({name: float for name in measures}).groupby(
        ["system", "novice_minutes", "method"]
    )
    means = groups[list(measures)].mean()
    means.insert(0, "trials", groups.size())
    return means.reset_index()


def page_table(frame: pd.DataFrame, measures: Iterable[str]) -> pd.DataFrame:
    """`table` with the headings of a page, and methods in words."""
    means = table(frame, measures)
    labels = means.method.map(METHOD_LABELS)
    return means.assign(method=labels).rename(columns=HEADINGS)


def crossings(frame: pd.DataFrame) -> pd.DataFrame:
    """Ratio of the novice's loss through the expert's parts to that through its own.

    `frame` has one row per model. The `change` is a text of CROSSED.
    """
    own, *columns = CROSSED
    crossed = [
        frame.assign(**{own: frame[column], "change": CROSSED[column]})
        for column in columns
    ]
    point = ["system", "novice_minutes"]
    return paired_comparison(pd.concat(crossed), frame, point, ["change"])


@styled
def figure(frame: pd.DataFrame) -> Figure:
    """Latents of both systems by two principal components, a panel a model."""
    order = ["system", "novice_minutes", "method"]
    rows = list(frame.sort_values(order).itertuples())
    count = max(len(rows), 1)
    figure, panels = side_by_side(count, min(count, 2))
    if not rows:
        finish(panels[0])
    for axes in panels[count:]:
        axes.set_axis_off()
    for axes, row in zip(panels, rows, strict=False):
        axes.set(xlabel="first component (-)", ylabel="second component (-)")
        of = f"{system_label(row.system)}, {row.novice_minutes:g} min"
        axes.set_title(f"{of}, {METHOD_LABELS[row.method]}")
        for role in ROLES:
            style = ROLE_STYLES[role] | {"linestyle": "", "ms": 3, "alpha": 0.5}
            points = np.array(getattr(row, f"{role}_picture")).T
            axes.plot(*points, label=role, **style)
        finish(axes)
    return figure


@styled
def crossed_figure(
    frame: pd.DataFrame, systems: Sequence[str] = PAPER_SYSTEMS
) -> Figure:
    """The loss on the novice's motion with each system's encoder and decoder.

    A row for each choice of parts, a dot for each method and size: means over seeds.
    The dots of all sizes but the smallest are hollow.
    """
    means = table(frame, CROSSED)
    sizes = sorted(means.novice_minutes.unique())
    figure, panels = dot_plots(len(systems), len(CROSSED), height=0.6)
    for axes, system in zip(panels, systems, strict=True):
        rows = means[means.system == system].sort_values(["novice_minutes", "method"])
        for number, row in enumerate(rows.itertuples()):
            style = METHOD_STYLES[row.method] | {"linestyle": "", "ms": 7}
            style |= {} if row.novice_minutes == sizes[0] else HOLLOW
            style["label"] = f"{style['label']}, {row.novice_minutes:g} min"
            losses = [getattr(row, name) for name in CROSSED]
            heights = np.arange(len(CROSSED)) + 0.1 * number
            axes.plot(losses, heights, **style)
        axes.set(title=system_label(system), xscale="log", xlabel="validation loss (-)")
        finish(axes, [0.2, 0.3, 0.5, 1, 2] if len(rows) else (), legend=False)
        if len(rows):
            name_rows(axes, list(CROSSED.values()))
    legend_below(figure, panels)
    return figure
