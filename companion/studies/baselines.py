"""The method among its neighbours: what each reaches on the same novice data, and what it costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd
from matplotlib.figure import Figure

from companion.figures.style import METHOD_STYLES, SIZE_STYLES, named
from companion.methods import BASELINES, COMPARED, FIGURE3, METHODS
from companion.statistics.pairs import beside
from companion.studies.throughput import Pace, seconds
from companion.study import Study
from companion.trials import Trial
from sidm.plots import finish, side_by_side, styled
from sidm.systems import SYSTEMS

POINT = ["system", "novice_minutes", "method"]


def trials(study: Study, system: str) -> list[Trial]:
    """Figure 3's methods and their neighbours on a small and a middle dataset; the expert alone has no size."""
    sizes = study.preset.baseline_minutes
    named = [one for one in (*FIGURE3, *BASELINES) if one != "expert_only"]
    largest = max(study.preset.novice_minutes(system))  # 'all_data'
    return [
        *study.points(system, named, sizes),
        *study.points(system, ["expert_only"], sizes[:1]),
        *study.points(system, ["novice_only"], [largest]),
    ]


def table(frame: pd.DataFrame, paces: Mapping[str, Pace] | None = None) -> pd.DataFrame:
    """A line a system, size and method, in the order of METHODS.

    Args:
        frame: of stored results, at most one a system, size, method and seed.
        paces: seconds of 1,000 samples by method, as `throughput.read` finds them.

    Returns:
        `seeds`; mean `loss`, `lowest` and `highest`; mean `samples` of prediction and
        pretraining; `minutes` of a core, at those paces or, where a method has none, as
        the trials took beside whatever ran then; and the ratio of the loss to that of
        each of the paper's methods with its interval, `to_sidm`, `to_sidm_low` and so
        on.

    Raises:
        ValueError: two results stand for the same point.
    """
    frame = frame.assign(
        samples=frame.samples + frame.pretraining_samples,
        minutes=seconds(frame, paces or {}).fillna(frame.seconds) / 60,
    )
    found = (
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
    for other in COMPARED:
        ratios = beside(frame[frame.method != other], frame[frame.method == other])
        names = {
            "ratio": f"to_{other}",
            "low": f"to_{other}_low",
            "high": f"to_{other}_high",
        }
        found = found.merge(
            ratios[[*POINT, *names]].rename(columns=names), how="left", on=POINT
        )
    order = found.method.map(list(METHODS).index)
    return (
        found.assign(order=order)
        .sort_values(["system", "novice_minutes", "order"])
        .drop(columns="order")
    )


@styled
def figure(
    table: pd.DataFrame, sizes: Sequence[float], systems: Sequence[str] = tuple(SYSTEMS)
) -> Figure:
    """Validation loss of each method, mean with minimum to maximum: a plot a system, a colour a size.

    Args:
        table: as `table` makes it.
        sizes: that the methods are compared at, min; those with other sizes are
            vertical lines.
        systems: a plot each.
    """
    figure, panels = side_by_side(len(systems))
    methods = [name for name in METHODS if name in set(table.method)]
    figure.set_size_inches(
        figure.get_size_inches()[0], 1.2 + 0.34 * max(len(methods), 5)
    )
    for axes, system in zip(panels, systems, strict=True):
        mine = table[table.system == system]
        for number, minutes in enumerate(sizes):
            here = mine[mine.novice_minutes == minutes]
            if len(here):
                ends = [
                    (here.loss - here.lowest).clip(0),
                    (here.highest - here.loss).clip(0),
                ]
                height = here.method.map(methods.index) + 0.16 * (
                    number - (len(sizes) - 1) / 2
                )
                style = SIZE_STYLES[number % len(SIZE_STYLES)] | {"linestyle": ""}
                axes.errorbar(
                    here.loss,
                    height,
                    xerr=ends,
                    capsize=2,
                    label=f"{minutes:g} min",
                    **style,
                )
        for one in mine[~mine.novice_minutes.isin(sizes)].itertuples():
            label = f"{METHOD_STYLES[one.method]['label']}, {one.novice_minutes:g} min"
            axes.axvline(one.loss, color="0.5", linestyle=":", marker="", label=label)
        axes.set(
            xlabel="validation loss, equation (1)",
            title=named(system),
            ylim=(len(methods) - 0.5, -0.5),
        )
        finish(axes)
        labels = (
            [METHOD_STYLES[name]["label"] for name in methods]
            if axes is panels[0]
            else [""] * len(methods)
        )
        axes.set_yticks(range(len(methods)), labels)
    return figure
