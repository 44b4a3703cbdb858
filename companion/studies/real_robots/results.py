"""What was found of real robots: losses and open-loop errors by size of data, beside each other seed by seed."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd
from matplotlib.figure import Figure

from companion.figures.style import METHOD_STYLES
from companion.statistics.pairs import beside
from companion.studies.real_robots.measure import ALONE, HELD_OUT, PAIRS
from sidm.plots import finish, side_by_side, styled

SIZED = (
    "minutes",
    "loss",
    "displacement",
    "heading",
    "cold_displacement",
    "cold_heading",
)
LABELS = {
    "loss": "loss (always the mean: 6)",
    "displacement": "displacement error after 1.5 s (m)",
    "heading": "heading error after 1.5 s (rad)",
}
SHOWN = (
    "novice_only",
    "sidm",
    "core_finetune",
    "pretrain_finetune",
    "least_squares",
    "differential_drive",
)
KINEMATIC = {"color": "#000000", "linestyle": (0, (1, 1)), "marker": ""}
NAMES = {
    "differential_drive": "ideal differential drive",
    "rotation_centres": "instantaneous centres of rotation",
}


def long(frame: pd.DataFrame) -> pd.DataFrame:
    """Records as a line a pair, method, seed and size; errors open loop are those after 1.5 s.

    What needs no expert stands in every pair of its novice.
    """
    found = frame.explode(["sessions", *SIZED]).assign(
        novice_minutes=lambda one: one.sessions.astype(float)
    )
    for name in SIZED[2:]:
        found[name] = found[name].str[-1]
    found = found.astype(dict.fromkeys(SIZED, float))
    pairs = []
    for pair, (expert, novice) in PAIRS.items():
        alone = (
            (found.novice == novice) & found.method.isin(ALONE) & (found.expert == "")
        )
        mine = found[alone | ((found.novice == novice) & (found.expert == expert))]
        pairs.append(mine.assign(system=pair))
    return pd.concat(pairs, ignore_index=True)


def table(
    frame: pd.DataFrame, value: str = "loss", against: str = "novice_only"
) -> pd.DataFrame:
    """Every method beside another, seed by seed: `pairs.beside`, below 1 where it predicts better.

    The intervals know that the seeds split the same sessions.

    Args:
        frame: of records.
        value: 'loss', or an error open loop after 1.5 s.
        against: the method that the others are held against.
    """
    every = long(frame)
    found = beside(
        every[every.method != against],
        every[every.method == against],
        value=value,
        held_out=HELD_OUT,
    )
    return found.rename(columns={"novice_minutes": "sessions"})


@styled
def figure(
    frame: pd.DataFrame,
    value: str = "loss",
    floors: Mapping[str, tuple[float, float]] | None = None,
) -> Figure:
    """Means over seeds against minutes of the novice's motion: a plot a pair, a line a method.

    Args:
        frame: of records.
        value: a key of LABELS.
        floors: by the novice, what the jitter of its pose alone costs, at least and at
            most.
    """
    every = long(frame)
    figure, (*panels, beside) = side_by_side(len(PAIRS) + 1, 2)
    for axes, (pair, (_, novice)) in zip(panels, PAIRS.items(), strict=True):
        mine = every[every.system == pair]
        for method in SHOWN if len(mine) else ():
            means = (
                mine[mine.method == method]
                .groupby("sessions")[["minutes", value]]
                .mean()
            )
            style = METHOD_STYLES.get(
                method, KINEMATIC | {"label": NAMES.get(method, method)}
            )
            axes.plot(means.minutes, means[value], **style)
        if floors and len(mine):
            axes.axhspan(
                *floors[novice],
                color="0.5",
                alpha=0.3,
                lw=0,
                label="jitter of the pose",
            )
        axes.set(
            xscale="log",
            yscale="log",
            xlabel="novice data (min)",
            ylabel=LABELS[value],
            title=pair,
        )
        finish(axes, (0.2, 0.5, 1, 2, 5), legend=False)
    beside.axis("off")
    beside.legend(*panels[0].get_legend_handles_labels(), loc="center", frameon=False)
    return figure
