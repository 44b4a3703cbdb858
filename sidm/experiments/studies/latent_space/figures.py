"""Latents in the plane of their first principal components."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from sidm.experiments.figures.style import (
    METHOD_STYLES,
    SIZE_STYLES,
    finish,
    side_by_side,
    styled,
)
from sidm.systems import ROLES

if TYPE_CHECKING:  # scikit-learn need not be there to draw the others
    from sidm.experiments.studies.latent_space.diagnosis import Diagnosis


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
