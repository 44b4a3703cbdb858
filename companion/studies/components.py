"""Which components of a transition does an SIDM predict better, from the same novice data?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.figures.style import named
from companion.methods import COMPARED
from companion.statistics.pairs import beside
from companion.statistics.tables import COMPONENTS
from companion.study import Study
from companion.trials import Trial
from sidm.plots import finish, side_by_side, styled
from sidm.systems import SYSTEMS

NAMES = [name for name, _ in COMPONENTS]


def trials(study: Study, system: str) -> list[Trial]:
    """The paper's two methods at every size, of Figure 3."""
    return [trial for trial in study.figure3(system) if trial.method in COMPARED]


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """The loss of each component with SIDM beside that without: `pairs.beside`, below 1 where SIDM predicts better."""
    long = frame.assign(component=[NAMES] * len(frame)).explode(
        ["component", "component_losses"]
    )
    sidm, alone = (
        long[long.method == method].astype({"component_losses": float})
        for method in COMPARED
    )
    return beside(
        sidm,
        alone,
        on=["system", "novice_minutes", "component"],
        value="component_losses",
    )


@styled
def figure(table: pd.DataFrame, systems: Sequence[str] = tuple(SYSTEMS)) -> Figure:
    """Ratios by component and size as colours, blue below 1; numbers where the whole interval lies to one side of 1."""
    figure, panels = side_by_side(len(systems))
    figure.set_figheight(5)
    for axes, system in zip(panels, systems, strict=True):
        mine = table[table.system == system].set_index(["component", "novice_minutes"])
        if len(mine):
            ratio = mine.ratio.unstack().reindex(NAMES)
            axes.imshow(np.log2(ratio), cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
            for (component, minutes), one in mine.iterrows():
                if one.high < 1 or one.low > 1:
                    place = list(ratio.columns).index(minutes), NAMES.index(component)
                    axes.text(
                        *place, f"{one.ratio:.2f}", ha="center", va="center", fontsize=7
                    )
            axes.set_xticks(
                range(len(ratio.columns)), [f"{minutes:g}" for minutes in ratio.columns]
            )
        axes.set(title=named(system), xlabel="novice data (min)")
        axes.grid(False)
        finish(axes, legend=False)
        if len(mine):
            axes.set_yticks(
                range(len(NAMES)), NAMES if axes is panels[0] else [""] * len(NAMES)
            )
    return figure
