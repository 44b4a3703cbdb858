"""What was found of latents: means by method and size, and a picture of each model's."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from sidm.experiments.figures.style import METHOD_STYLES, SIZE_STYLES, finish, side_by_side, styled
from sidm.systems import ROLES

if TYPE_CHECKING:
    import pandas as pd

ALIKE = ("linear_accuracy", "network_accuracy", "raw_accuracy", "a_distance", "mmd", "discriminator_accuracy")
CROSSED = ("validation_loss", "expert_encoder_loss", "expert_decoder_loss", "expert_path_loss")


def table(frame: pd.DataFrame, measures: Sequence[str] = ALIKE) -> pd.DataFrame:
    """Number of models and means of some measures by system, size and method."""
    groups = frame.astype({name: float for name in measures}).groupby(["system", "novice_minutes", "method"])
    found = groups[list(measures)].mean()
    found.insert(0, "trials", groups.size())
    return found.reset_index()


@styled
def figure(frame: pd.DataFrame) -> Figure:
    """Latents of both systems in the plane of their first two principal components, a plot a model."""
    ordered = list(frame.sort_values(["system", "novice_minutes", "method"]).itertuples())
    figure, panels = side_by_side(max(len(ordered), 1), min(max(len(ordered), 1), 4))
    if not ordered:
        finish(panels[0])
        return figure
    for axes, one in itertools.zip_longest(panels, ordered):
        if one is None:
            axes.set_axis_off()
            continue
        axes.set(xlabel="first component (-)", ylabel="second component (-)")
        axes.set_title(f"{one.system}, {one.novice_minutes:g} min\n{METHOD_STYLES[one.method]['label']}")
        for role, style in zip(ROLES, SIZE_STYLES, strict=False):
            points = np.array(getattr(one, f"{role}_picture")).T
            axes.plot(*points, style["marker"], color=style["color"], ms=3, alpha=0.5, label=role)
        finish(axes)
    return figure
