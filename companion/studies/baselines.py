"""SIDM among other methods: what each reaches on the same novice data, and its cost."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.style import (
    METHOD_STYLES,
    SIZE_STYLES,
    share_labels,
    system_label,
)
from companion.methods import BASELINES, COMPARED, FIGURE3, METHODS
from companion.statistics.pairs import paired_comparison
from companion.studies.reproduction import with_repeats
from companion.studies.throughput import Pace, seconds
from companion.study import Study
from companion.trials import Trial
from ownrobot.comparison.statistics import Interval
from sidm.plots import finish, side_by_side, styled
from sidm.systems import PAPER_SYSTEMS

POINT = ["system", "novice_minutes", "method"]
#: Column of the ratio to each of the paper's methods, on a page.
RATIOS = {"sidm": "to SIDM's (95 % interval)", "novice_only": "to that without SIDM"}


def trials(study: Study, system: str) -> list[Trial]:
    """Trials of Figure 3's methods and the baselines on a small and a middle dataset.

    `expert_only` uses no novice data, so it is run at one size. `novice_only` is also
    run on the largest dataset, as the method `all_data`.
    """
    sizes = study.preset.baseline_minutes
    methods = [name for name in (*FIGURE3, *BASELINES) if name != "expert_only"]
    largest = max(study.preset.novice_minutes(system))
    return [
        *study.points(system, methods, sizes),
        *study.points(system, ["expert_only"], sizes[:1]),
        *study.points(system, ["novice_only"], [largest]),
    ]


def table(
    frame: pd.DataFrame,
    results: str | Path,
    paces: Mapping[str, Pace] | None = None,
) -> pd.DataFrame:
    """Losses and costs of each method, one row per system, size and method.

    Losses are divided on one motion, where the paper's method was repeated on the
    other's. Two results of one point raise ValueError.

    Returns:
        Rows in the order of METHODS: `seeds`; mean `loss`, `lowest` and `highest`; mean
        `samples` of prediction and pretraining; mean `minutes` of one core, from the
        method's pace, or, where it has none, as long as the trials took beside whatever
        ran at that time; and the ratio of the loss to that of each of the paper's
        methods with its interval, `to_sidm`, `to_sidm_low` and so on.
    """
    frame = frame.assign(
        samples=frame.samples + frame.pretraining_samples,
        minutes=seconds(frame, paces or {}).fillna(frame.seconds) / 60,
    )
    means = (
        frame.groupby(POINT, sort=False)
        .agg(
            seeds=("seed", "size"),
            loss=("validation_loss", "mean"),
            lowest=("validation_loss", "min"),
            highest=("validation_loss", "max"),
            samples=("samples", "mean"),
            minutes=("minutes", "mean"),
        )
        .reset_index()
    )
    for paper in COMPARED:
        rest, reference = frame[frame.method != paper], frame[frame.method == paper]
        ends = {"low": f"to_{paper}_low", "high": f"to_{paper}_high"}
        names = {"ratio": f"to_{paper}"} | ends
        reference = with_repeats(reference, results)
        ratios = paired_comparison(rest, reference)[[*POINT, *names]]
        means = means.merge(ratios.rename(columns=names), how="left", on=POINT)
    order = means.method.map(list(METHODS).index)
    return (
        means.assign(order=order)
        .sort_values(["system", "novice_minutes", "order"])
        .drop(columns="order")
    )


def page_tables(table: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """A title and a table of texts for each system and size of `table`."""
    for (system, minutes), rows in table.groupby(["system", "novice_minutes"]):
        labels = [METHODS[name].label for name in rows.method]
        shown = pd.DataFrame({"method": labels, "seeds": rows.seeds.tolist()})
        shown["loss"] = [f"{loss:.3f}" for loss in rows.loss]
        for other, name in RATIOS.items():
            columns = [f"to_{other}{end}" for end in ("", "_low", "_high")]
            shown[name] = [
                "-" if pd.isna(ends[0]) else Interval(*ends).text(3)
                for ends in rows[columns].itertuples(index=False)
            ]
        shown["samples"] = [f"{count:,.0f}" for count in rows.samples]
        shown["minutes"] = [f"{spent:.1f}" for spent in rows.minutes]
        yield f"{system_label(system)}, {minutes:g} min of novice data", shown


@styled
def figure(
    table: pd.DataFrame, sizes: Sequence[float], systems: Sequence[str] = PAPER_SYSTEMS
) -> Figure:
    """Mean validation loss of each method, with bars from minimum to maximum.

    Each of the `sizes`, min of novice data, has a colour; the mean losses at other
    sizes are vertical lines.
    """
    figure, panels = side_by_side(len(systems))
    methods = [name for name in METHODS if name in set(table.method)]
    width, _ = figure.get_size_inches()
    figure.set_size_inches(width, 1.2 + 0.34 * max(len(methods), 5))
    for axes, system in zip(panels, systems, strict=True):
        rows = table[table.system == system]
        for number, minutes in enumerate(sizes):
            points = rows[rows.novice_minutes == minutes]
            shift = 0.16 * (number - (len(sizes) - 1) / 2)
            if len(points):
                height = points.method.map(methods.index) + shift
                style = SIZE_STYLES[number % len(SIZE_STYLES)] | {"linestyle": ""}
                _draw_losses(axes, points, height, f"{minutes:g} min", style)
        for row in rows[~rows.novice_minutes.isin(sizes)].itertuples():
            label = f"{METHOD_STYLES[row.method]['label']}, {row.novice_minutes:g} min"
            axes.axvline(row.loss, color="0.5", linestyle=":", marker="", label=label)
        axes.set(xlabel="validation loss, equation (1)", title=system_label(system))
        axes.set_ylim(max(len(methods), 1) - 0.5, -0.5)
        finish(axes)
        labels = [METHOD_STYLES[name]["label"] for name in methods]
        axes.set_yticks(range(len(methods)), labels)
    share_labels(panels)
    return figure


def _draw_losses(
    axes: Axes, rows: pd.DataFrame, height: pd.Series, label: str, style: Mapping
) -> None:
    """Draw the losses of one size as points with bars from lowest to highest."""
    below, above = rows.loss - rows.lowest, rows.highest - rows.loss
    bars = [below.clip(0), above.clip(0)]
    axes.errorbar(rows.loss, height, xerr=bars, capsize=2, label=label, **style)
