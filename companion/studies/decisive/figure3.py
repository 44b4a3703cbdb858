"""The paper's Figure 3 with recipe R, as released: loss against novice data.

What the paper says in numbers stands beside it; sizes that it has and we did not run
are named.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.style import (
    LOSS_BY_SIZE,
    METHOD_STYLES,
    legend_below,
    mean_and_range,
    system_label,
)
from companion.methods import COMPARED
from companion.presets import PRESETS
from companion.studies.decisive.arms import FINETUNING
from companion.studies.decisive.verdicts import AT, PAPER, RELEASED, losses_by
from ownrobot.plots import finish, side_by_side, styled
from sidm.systems import PAPER_SYSTEMS

#: min of novice data in the paper's Figure 3
SIZES = {name: PRESETS["paper"].novice_minutes(name) for name in PAPER_SYSTEMS}
MEET = {"system1": 120.0, "system2": 300.0}  # min from which curves are "comparable"
#: methods that stand beside the paper's two, as thin lines
BESIDE = ("least_squares", FINETUNING)
SMALL: dict[str, Any] = {
    "fontsize": "small",
    "bbox": {"facecolor": "white", "edgecolor": "none", "pad": 1},
}
MARK: dict[str, Any] = {"color": "0.45", "linestyle": ":", "marker": "", "lw": 1.2}


def table(
    frame: pd.DataFrame, rule: str = RELEASED, quick: pd.DataFrame | None = None
) -> pd.DataFrame:
    """Losses of Figure 3: a row per training with its `recipe` and its `loss`.

    The paper's two methods have recipe R. Of the methods BESIDE the release says
    nothing: they have recipe T, or Q, from the results `quick`, where T has not been
    run. `frame` has rows of `verdicts.results`, `rule` is a key of RULES.
    """
    recipe = frame.recipe.eq("R") & frame.method.isin(COMPARED)
    tuned = frame.recipe.eq("T") & frame.method.isin(BESIDE)
    trained = losses_by(frame[recipe | tuned], rule)
    if quick is None:
        return trained
    arms = ["system", "method"]
    known = pd.MultiIndex.from_frame(frame[tuned][arms])
    others = quick[quick.method.isin(BESIDE)]
    others = others[~pd.MultiIndex.from_frame(others[arms]).isin(known)]
    others = others.assign(recipe="Q", loss=others.validation_loss)
    return pd.concat([part for part in (trained, others) if len(part)] or [trained])


@styled
def figure(losses: pd.DataFrame, systems: Sequence[str] = tuple(SIZES)) -> Figure:
    """Figure 3 under recipe R, of the rows of `table`: a panel per system.

    Lines are means over seeds, shades reach from the least to the greatest. The arrow
    is as long as the paper's number says: from the SIDM's loss at AT minutes to where
    training alone should have it. A dotted line stands where the paper's curves meet.
    A system that the paper does not have gets no mark.
    """
    figure, panels = side_by_side(len(systems), 2)
    for axes, system in zip(panels, systems, strict=False):
        axes.set(title=system_label(system), **LOSS_BY_SIZE)
        shown = losses[losses.system == system]
        for method in (*COMPARED, *BESIDE):
            group = shown[shown.method == method]
            if len(group):
                _draw(axes, method, group)
        ours = tuple(sorted(set(shown[shown.method.isin(COMPARED)].novice_minutes)))
        sizes = SIZES.get(system, ours)
        if sizes:
            axes.set_xlim(0.8 * min(sizes), 1.25 * max(sizes))
        if system in MEET:
            _mark(axes, system, shown)
        finish(axes, sizes, legend=False)
        named = (*ours, MEET.get(system))
        axes.set_xticks(sizes, [f"{s:g}" if s in named else "" for s in sizes])
        lacking = [f"{size:g}" for size in sizes if size not in ours]
        if lacking:
            axes.annotate(
                f"not run: {', '.join(lacking)} min",
                (0.99, 0.97),
                xycoords="axes fraction",
                ha="right",
                va="top",
                color="0.35",
                **SMALL,
            )
    legend_below(figure, panels)
    return figure


def _draw(axes: Axes, method: str, group: pd.DataFrame) -> None:
    """Draw a method's mean over seeds; of the paper's two the range, too."""
    by_size = group.groupby("novice_minutes").loss.agg(["mean", "min", "max"])
    style = dict(METHOD_STYLES[method])
    if method in COMPARED:
        mean_and_range(axes, by_size, **style)
        return
    style["label"] += f" ({group.recipe.iloc[0]})"
    thin = {"lw": 1.0, "ms": 3.5, "zorder": 1.8}
    axes.plot(by_size.index, by_size["mean"], **style | thin)


def _mark(axes: Axes, system: str, shown: pd.DataFrame) -> None:
    axes.axvline(MEET[system], label="the paper's curves meet", **MARK)
    start = shown[(shown.method == "sidm") & (shown.novice_minutes == AT)].loss.mean()
    if pd.notna(start):
        times = PAPER[system]
        arrow = {"arrowstyle": "->", "color": "0.25", "lw": 1.2}
        axes.annotate("", (times * AT, start), (AT, start), arrowprops=arrow)
        text, beside = f"paper: {times:g} times", {"textcoords": "offset points"}
        bbox = SMALL["bbox"] | {"alpha": 0.8}
        look = SMALL | beside | {"bbox": bbox, "va": "center"}
        axes.annotate(text, (times * AT, start), (5, 0), **look)
