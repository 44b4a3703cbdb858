"""Losses and open-loop errors of real robots by size of data: a table and a figure."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd
from matplotlib.figure import Figure

from companion.figures.style import METHOD_LABELS, METHOD_STYLES, legend_entries
from companion.statistics.pairs import page_table, paired_comparison
from companion.statistics.tables import wide
from companion.studies.real_robots.measure import (
    ALONE,
    HELD_OUT,
    PAIRS,
    PRETRAINED,
    WITH_EXPERT,
)
from ownrobot.plots import finish, side_by_side, styled

#: Fields of a record that have an entry per size.
SIZED = ["minutes", "loss", "displacement", "heading"]
SIZED += ["cold_displacement", "cold_heading"]
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
KINEMATIC_STYLE = {"color": "#000000", "linestyle": (0, (1, 1)), "marker": ""}
#: Labels of kinematic models.
NAMES = {
    "differential_drive": "ideal differential drive",
    "rotation_centres": "instantaneous centres of rotation",
}


def long(frame: pd.DataFrame) -> pd.DataFrame:
    """Records in long form: a row per pair, method, seed and size.

    Open-loop errors are those after 1.5 s. Methods without an expert have rows in every
    pair of their novice.
    """
    rows = frame.explode(["sessions", *SIZED])
    rows["novice_minutes"] = rows.sessions.astype(float)
    for name in SIZED[2:]:
        rows[name] = rows[name].str[-1]
    rows = rows.astype(dict.fromkeys(SIZED, float))
    alone = rows.method.isin(ALONE) & (rows.expert == "")
    pairs = []
    for pair, (expert, novice) in PAIRS.items():
        of_pair = (rows.novice == novice) & (alone | (rows.expert == expert))
        pairs.append(rows[of_pair].assign(system=pair))
    return pd.concat(pairs, ignore_index=True)


def table(
    frame: pd.DataFrame, value: str = "loss", against: str = "novice_only"
) -> pd.DataFrame:
    """Every method compared with another, seed by seed, by the loss or an error.

    The intervals take into account that the seeds split the same sessions. The table is
    made by `pairs.paired_comparison`, with `sessions` as the size; a ratio below 1 says
    that the method predicts better.
    """
    rows = long(frame)
    compared = paired_comparison(
        rows[rows.method != against],
        rows[rows.method == against],
        value=value,
        held_out=HELD_OUT,
    )
    return compared.rename(columns={"novice_minutes": "sessions"})


def seconds_unbeaten(frame: pd.DataFrame) -> str:
    """From how much of its motion on no network beat least squares on the Warthog.

    Seconds of motion, six for each session, as text; 'not run' without results.
    """
    networks = ("novice_only", *WITH_EXPERT, PRETRAINED)
    squares = table(frame, against="least_squares")
    rows = squares[
        (squares.system == "husky to warthog") & squares.method.isin(networks)
    ]
    least = rows.groupby("sessions").ratio.min()
    unbeaten = least[least > 1]
    return f"{6 * unbeaten.index.min():.0f}" if len(unbeaten) else "not run"


def percent_better(compared: pd.DataFrame, pair: str, sessions: int) -> dict[str, str]:
    """By how many per cent each method's loss is lower, with its interval, as text.

    Of a table made by `table`, for a pair and a number of the novice's sessions.
    """
    rows = compared[(compared.system == pair) & (compared.sessions == sessions)]
    return {
        row.method: "{:.0f} ({:.0f} to {:.0f})".format(
            *(100 * (1 - end) for end in (row.ratio, row.high, row.low))
        )
        for row in rows.itertuples()
    }


def for_page(table: pd.DataFrame) -> pd.DataFrame:
    """A table made by `table` as a page shows it: a column for each size."""
    shown = page_table(table.sort_values("sessions", kind="stable"), 2, system="pair")
    shown["method"] = shown.method.map(METHOD_LABELS | NAMES)
    shown["sessions"] = [f"{count:g} sessions" for count in shown.sessions]
    shown = wide(shown, ["pair", "method"], "sessions", "ratio (95 % interval)")
    heading = "loss, divided by that without SIDM (95 % interval)"
    return shown.rename(columns={"method": heading})


@styled
def figure(
    frame: pd.DataFrame,
    value: str = "loss",
    floors: Mapping[str, tuple[float, float]] | None = None,
) -> Figure:
    """Means over seeds of a key of LABELS against minutes of the novice's motion.

    A panel per pair, a curve per method. `floors` are the errors due to the jitter of a
    novice's pose alone, least and greatest.
    """
    rows = long(frame)
    figure, (*panels, legend_panel) = side_by_side(len(PAIRS) + 1, 2)
    for axes, (pair, (_, novice)) in zip(panels, PAIRS.items(), strict=True):
        shown = rows[rows.system == pair]
        for method in SHOWN if len(shown) else ():
            groups = shown[shown.method == method].groupby("sessions")
            means = groups[["minutes", value]].mean()
            kinematic_style = KINEMATIC_STYLE | {"label": NAMES.get(method, method)}
            style = METHOD_STYLES.get(method, kinematic_style)
            axes.plot(means.minutes, means[value], **style)
        if floors and len(shown):
            low, high = floors[novice]
            axes.axhspan(
                low, high, color="0.5", alpha=0.3, lw=0, label="jitter of the pose"
            )
        axes.set(
            xscale="log",
            yscale="log",
            xlabel="novice data (min)",
            ylabel=LABELS[value],
            title=pair,
        )
        finish(axes, (0.2, 0.5, 1, 2, 5), legend=False)
    legend_panel.axis("off")
    drawn = legend_entries(panels)
    legend_panel.legend(drawn.values(), drawn.keys(), loc="center", frameon=False)
    return figure
