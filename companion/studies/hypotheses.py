"""What might limit the SIDM: hypotheses, tested by changes of SIDM.

They are how alike the robots are, learning from both at once, parts of their own, the
adversary, the balance of the phases, p_e, the stopping rule, the encoder's first layer
behind the map, the optimiser of parts without gradient, and the composition of batches.
The losses of each change are compared with those of SIDM without the change.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.engine.store import Results
from companion.figures.dots import (
    HOLLOW,
    dot_plots,
    line_of_no_difference,
    name_rows,
)
from companion.figures.style import METHOD_STYLES, legend_below, system_label
from companion.methods import (
    BOTH_OF_SIDM,
    CHOICES,
    METHODS,
    RELEASED,
)
from companion.statistics.claims import BETTER, NO_VERDICT, WORSE, ratio_verdicts
from companion.statistics.pairs import paired_comparison
from companion.studies import ablations, choices
from companion.studies.reproduction import with_repeats
from companion.study import Study
from companion.trials import Trial
from ownrobot.plots import finish, styled
from sidm.systems import PAPER_SYSTEMS

#: Other methods that learn from two systems.
REPLACED = (
    "no_regularisation",
    "strong_matching",
    "mmd",
    "coral",
    "gradient_reversal",
    "pooled",
    "pooled_flag",
    "pretrain_finetune",
    "expert_only",
)

UNCHANGED = "as it is"
#: Pair of robots -> marker of its dots.
MARKERS = dict(zip(PAPER_SYSTEMS, ("o", "s"), strict=True))
POINT = ["system", "novice_minutes"]


def changes(study: Study, system: str) -> Iterator[tuple[str, list[Trial]]]:
    """All changes of a system's SIDM by training it differently, with their trials."""
    preset = study.preset
    sizes, sidm = preset.baseline_minutes, preset.training_of(METHODS["sidm"], system)
    for method in REPLACED:
        # expert_only uses no novice data: one size is enough
        at = sizes[:1] if method == "expert_only" else sizes
        yield METHODS[method].label, study.points(system, [method], at)
    chosen = CHOICES | {BOTH_OF_SIDM: RELEASED[BOTH_OF_SIDM]}
    for choice, trials in choices.changed(study, system, chosen).items():
        yield choice, [trial for trial in trials if trial.method == "sidm"]
    for p in ablations.VALUES["p_expert"]:
        if p not in (None, 0.0, sidm.p_expert):
            yield f"p_e of {p:g}", ablations.ablation(study, system, "p_expert", [p])
    for phase, values in ablations.ITERATIONS.items():
        for value in values:
            if value not in (0, getattr(sidm, phase)):
                trials = ablations.ablation(study, system, phase, [value])
                yield f"{value} {phase.replace('_', ' ')}", trials
    for pixels in ablations.VALUES["pixels"]:
        if pixels != preset.network.pixels:
            trials = ablations.ablation(study, system, "pixels", [pixels])
            trials = [trial for trial in trials if trial.method == "sidm"]
            yield f"maps of {pixels} pixels", trials
    yield from ablations.most_data(study, system).items()


def _unchanged(study: Study, system: str) -> list[Trial]:
    """The trials of SIDM as it is, each once."""
    preset = study.preset
    sizes = dict.fromkeys([*preset.novice_minutes(system), *preset.baseline_minutes])
    return study.points(system, ["sidm"], sizes)


def trials(study: Study, system: str) -> list[Trial]:
    """The trials of SIDM as it is and with every change, each once."""
    every = _unchanged(study, system)
    every += [trial for _, trials in changes(study, system) for trial in trials]
    return list({trial.key: trial for trial in every}.values())


def frame(study: Study, store: Results, systems: Iterable[str]) -> pd.DataFrame:
    """Stored results by `change`; SIDM itself has change UNCHANGED."""
    parts = []
    for system in systems:
        unchanged = UNCHANGED, _unchanged(study, system)
        for change, trials in (unchanged, *changes(study, system)):
            parts.append(store.frame(trials, curves=True).assign(change=change))
    return pd.concat(parts)


def table(frame: pd.DataFrame, results: str | Path) -> pd.DataFrame:
    """Ratios of the losses of changed SIDMs to the losses of the unchanged SIDM.

    Both losses of a ratio are from the same simulated motion, if the unchanged SIDM was
    also run on the motion of the other machine. The table is made by
    `pairs.paired_comparison`, with a `verdict`, sorted by system, size and ratio, the
    lowest ratio first.
    """
    sidm = frame.change == UNCHANGED
    reference = with_repeats(frame[sidm], results)
    compared = paired_comparison(frame[~sidm], reference, POINT, ["change"])
    compared["verdict"] = ratio_verdicts(compared)
    return compared.sort_values([*POINT, "ratio"], ignore_index=True)


def ranking(table: pd.DataFrame) -> pd.DataFrame:
    """Changes sorted by the least ratio that they reach, of the rows of `table`.

    One row per change: the number of `comparisons` with an interval, in how many of
    them the change is `better` or `worse` (the whole interval lies on one side of 1),
    and the `least` and `greatest` ratio.
    """
    clear = table[table.verdict != NO_VERDICT]
    clear = clear.assign(better=clear.verdict == BETTER, worse=clear.verdict == WORSE)
    counts = clear.groupby("change").agg(
        comparisons=("ratio", "size"),
        better=("better", "sum"),
        worse=("worse", "sum"),
        least=("ratio", "min"),
        greatest=("ratio", "max"),
    )
    return counts.sort_values("least").reset_index()


@styled
def figure(compared: pd.DataFrame) -> Figure:
    """A row per change with a dot for each of its comparisons, the lowest ratio on top.

    A dot is filled where the whole interval lies on one side of 1. Of the rows of
    `table`, changes with one comparison are left out.
    """
    ranked = ranking(compared)
    rows = ranked[ranked.comparisons > 1].reset_index(drop=True)
    drawn, (axes,) = dot_plots(1, len(rows))
    if not len(rows):
        finish(axes, notice="no change has two comparisons\nwith an interval")
        return drawn
    shown = compared[compared.verdict != NO_VERDICT]
    shown = shown[shown.change.isin(rows.change)]
    heights = shown.change.map({name: row for row, name in rows.change.items()})
    apart = shown.verdict.isin([BETTER, WORSE])
    dots = {"color": METHOD_STYLES["sidm"]["color"], "linestyle": "", "ms": 7}
    for (system, marker), filled in itertools.product(MARKERS.items(), (True, False)):
        here = (shown.system == system) & (apart == filled)
        if here.any():
            label = system_label(system) if filled else None
            look = dots | {"marker": marker} | ({} if filled else HOLLOW)
            axes.plot(shown.ratio[here], heights[here], label=label, **look)
    line_of_no_difference(axes)
    axes.set(xscale="log", xlabel="loss after the change / loss of the SIDM")
    finish(axes, [0.6, 0.7, 0.8, 0.9, 1, 1.2, 1.5, 2], legend=False)
    ends = rows[["least", "greatest"]].itertuples(index=False)
    names = [name.replace("p_e", "$p_e$") for name in rows.change]
    name_rows(axes, names, [f"{low:.2f} to {high:.2f}" for low, high in ends])
    legend_below(drawn, [axes])
    return drawn


def memorised(frame: pd.DataFrame) -> pd.DataFrame:
    """Mean `training` and `validation` loss by method and size, and their `ratio`.

    The training loss of a trial is the mean over three points of its learning curve:
    the point nearest to the weights that were kept and its two neighbours.
    """
    trainings = []
    for row in frame.itertuples():
        kept = _kept_point(row)
        near = row.curve_training_loss[max(kept - 1, 0) : kept + 2]
        trainings.append(float(np.mean(near)))
    order = {name: number for number, name in enumerate(METHODS)}
    means = (
        frame.assign(training=trainings, order=frame.method.map(order))
        .groupby(["system", "order", "method", "novice_minutes"])
        .agg(training=("training", "mean"), validation=("validation_loss", "mean"))
        .reset_index()
        .drop(columns="order")
    )
    return means.assign(ratio=means.validation / means.training)


def _kept_point(row: Any) -> int:
    """Index of the learning curve's point nearest to the weights that were kept.

    A training that its patience stopped had its lowest test loss `patience` samples
    before the end. For other trainings it is the minimum of the curve's smoothed test
    losses.
    """
    if row.stopping == "test_loss" and row.samples < row.max_samples:
        best = row.samples - row.patience
        return int(np.abs(np.array(row.curve_samples) - best).argmin())

    def smooth(past: float, now: float) -> float:
        return row.smoothing * past + (1 - row.smoothing) * now

    return int(np.argmin(list(itertools.accumulate(row.curve_test_loss, smooth))))
