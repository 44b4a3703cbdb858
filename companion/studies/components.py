"""Which components of a transition does SIDM predict better from equal novice data?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.figures.style import share_labels, system_label
from companion.methods import COMPARED
from companion.statistics.pairs import paired_comparison
from companion.statistics.tables import COMPONENTS
from companion.study import Study
from companion.trials import Trial
from ownrobot.plots import finish, side_by_side, styled
from sidm.systems import PAPER_SYSTEMS

NAMES = [name for name, _ in COMPONENTS]


def trials(study: Study, system: str) -> list[Trial]:
    """The paper's two methods at every size, taken from Figure 3."""
    return [trial for trial in study.figure3(system) if trial.method in COMPARED]


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """Ratio of each component's loss with SIDM to its loss without.

    The table is made by `pairs.paired_comparison`, one row per system, size and
    component; a ratio below 1 means that SIDM predicts the component better.
    """
    long = frame.assign(component=[NAMES] * len(frame)).explode(
        ["component", "component_losses"]
    )
    long = long.astype({"component_losses": float})
    sidm, alone = (long[long.method == method] for method in COMPARED)
    point = ["system", "novice_minutes", "component"]
    return paired_comparison(sidm, alone, on=point, value="component_losses")


@styled
def figure(table: pd.DataFrame, systems: Sequence[str] = PAPER_SYSTEMS) -> Figure:
    """Ratios by component and size as colours, blue below 1, one plot per system.

    Numbers stand where the whole interval lies on one side of 1.
    """
    figure, panels = side_by_side(len(systems))
    figure.set_figheight(5)
    for axes, system in zip(panels, systems, strict=True):
        rows = table[table.system == system].set_index(["component", "novice_minutes"])
        if len(rows):
            ratio = rows.ratio.unstack().reindex(NAMES)
            sizes = list(ratio.columns)
            axes.imshow(np.log2(ratio), cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
            for (component, minutes), row in rows.iterrows():
                if row.high < 1 or row.low > 1:
                    x, y = sizes.index(minutes), NAMES.index(component)
                    text = f"{row.ratio:.2f}"
                    axes.text(x, y, text, ha="center", va="center", fontsize=9)
            axes.set_xticks(range(len(sizes)), [f"{minutes:g}" for minutes in sizes])
        axes.set(title=system_label(system), xlabel="novice data (min)")
        axes.grid(False)
        finish(axes, legend=False)
        if len(rows):
            axes.set_yticks(range(len(NAMES)), NAMES)
    share_labels([axes for axes in panels if axes.images])
    return figure
