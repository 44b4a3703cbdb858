"""Ablations of the paper's advice: one value of SIDM's training changed at a time, on a small novice dataset."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.curves import size_style
from companion.figures.style import (
    LOSS_LABEL,
    METHOD_STYLES,
    SIZE_STYLES,
    legend_below,
    named,
)
from companion.methods import CHOICES, COMPARED, METHODS
from companion.methods import PATIENCE as LONG_PATIENCE
from companion.presets import Preset
from companion.statistics.tables import spread
from companion.study import Study
from companion.trials import Trial
from sidm.config import ConfigError, replace
from sidm.plots import finish, side_by_side, styled
from sidm.shards import trajectories_for
from sidm.systems import SYSTEMS

EMPTY: Mapping[str, float] = MappingProxyType({})

#: Values of p_e; None stands for 'proportional to the data'.
P_EXPERT = (0.0, 0.25, 0.5, 0.75, 0.9, None)

#: Iterations a phase, by the name of the phase.
ITERATIONS = {
    "prediction_iterations": (20, 100, 500),
    "discriminator_iterations": (5, 20, 100),
    "matching_iterations": (0, 5, 20, 100),
}

#: Pixels a side of the height map; the paper has 300, the released code 64.
PIXELS = (16, 32, 64)

#: Samples without a new minimum of the test loss before training ends.
PATIENCE = (50_000, 150_000, 450_000)


#: p_e with as much novice data as there is; section 5 advises less than with little.
MOST_DATA_P_EXPERT = 0.25


def most_data(study: Study, system: str) -> dict[str, list[Trial]]:
    """SIDM on the largest novice dataset as section 5 advises there: the expert and the adversary count for less.

    Patience is among it because it counts the samples of both systems: at a p_e of 0.75
    a quarter are the novice's.
    """
    sizes = [max(study.preset.novice_minutes(system))]
    changed = replace(
        study.preset.training_of(METHODS["sidm"], system), p_expert=MOST_DATA_P_EXPERT
    )
    patient = study.changed(**CHOICES[LONG_PATIENCE][0])
    return {
        f"p_e of {MOST_DATA_P_EXPERT:g}": study.points(
            system, ["sidm"], sizes, changed
        ),
        METHODS["no_regularisation"].label: study.points(
            system, ["no_regularisation"], sizes
        ),
        LONG_PATIENCE: patient.points(system, ["sidm"], sizes),
    }


def most_data_trials(study: Study, system: str) -> list[Trial]:
    """All trials of `most_data`."""
    return [trial for trials in most_data(study, system).values() for trial in trials]


def proportional(preset: Preset, minutes: float) -> float:
    """The p_e that is proportional to the sizes of the data, which the paper advises against."""
    expert, novice = trajectories_for(preset.expert_minutes), trajectories_for(minutes)
    return round(expert / (expert + novice), 6)


def p_expert(
    study: Study,
    system: str,
    values: Iterable[float | None] = P_EXPERT,
    sizes: Sequence[float] = (),
) -> list[Trial]:
    """Ablation of p_e; at 0 the expert is never seen, in the regularisation neither."""
    trials = []
    for minutes in sizes or study.preset.ablation_minutes:
        for value in values:
            p = proportional(study.preset, minutes) if value is None else value
            training = replace(
                study.preset.training_of(METHODS["sidm"], system),
                p_expert=p,
                regularise=p > 0,
            )
            method = "sidm" if p > 0 else "novice_only"
            trials += study.points(
                system, [method], [minutes], training, study.preset.ablation_seeds
            )
    return trials


def iterations(
    study: Study,
    system: str,
    phase: str,
    values: Iterable[int] | None = None,
    sizes: Sequence[float] = (),
) -> list[Trial]:
    """Ablation of the iterations of one phase; 0 of matching leave out the regularisation, of others: ConfigError."""
    trials = []
    for value in ITERATIONS[phase] if values is None else values:
        if value == 0 and phase != "matching_iterations":
            raise ConfigError(
                f"{phase} must be at least 1; without an adversary there are 0 matching_iterations"
            )
        method = "sidm" if value > 0 else "no_regularisation"
        training = study.preset.training_of(METHODS[method], system)
        if value > 0:
            training = replace(training, **{phase: value})
        sizes = sizes or study.preset.ablation_minutes
        trials += study.points(
            system, [method], sizes, training, study.preset.ablation_seeds
        )
    return trials


def setting(
    study: Study,
    system: str,
    name: str,
    values: Iterable[int],
    sizes: Sequence[float] = (),
) -> list[Trial]:
    """Ablation of a setting that both of the paper's methods have, of their training or their network."""
    sizes = sizes or study.preset.ablation_minutes
    return [
        trial
        for value in values
        for trial in study.changed(**{name: value}).points(
            system, COMPARED, sizes, seeds=study.preset.ablation_seeds
        )
    ]


def phases(study: Study, system: str) -> list[Trial]:
    """The ablations of all three phases."""
    return [trial for phase in ITERATIONS for trial in iterations(study, system, phase)]


def pixels(study: Study, system: str) -> list[Trial]:
    """The ablation of the map's resolution."""
    return setting(study, system, "pixels", PIXELS)


def patience(study: Study, system: str) -> list[Trial]:
    """The ablation of the patience."""
    return setting(study, system, "patience", PATIENCE)


def table(frame: pd.DataFrame, name: str, by_method: bool = False) -> pd.DataFrame:
    """Number, mean, minimum and maximum of validation losses by system, size, method if asked for, and `value`.

    Args:
        frame: of the ablation of `name`.
        name: of the value, a setting of the training or the network.
        by_method: whether each method has lines of its own; else what a value makes of
            it stands with the rest.
    """
    value = frame[name]
    if name == "matching_iterations":  # none without regularisation
        value = value.where(frame.regularise, 0)
    return spread(
        frame.assign(value=value),
        ["system", "novice_minutes", *["method"] * by_method, "value"],
    )


#: What is ablated, on its axis.
_AXES = {
    "p_expert": "$p_e$, probability of drawing the expert (-)",
    "prediction_iterations": "prediction iterations a phase",
    "discriminator_iterations": "discriminator iterations a phase",
    "matching_iterations": "matching iterations a phase",
    "pixels": "pixels a side of the height map",
    "patience": "patience (samples)",
}


@styled
def figure(
    table: pd.DataFrame,
    name: str,
    systems: Sequence[str] = tuple(SYSTEMS),
    usual: Mapping[str, float] = EMPTY,
) -> Figure:
    """Validation loss against an ablated value, a line a size and method: mean over seeds with minimum to maximum.

    A probability has an axis of its own; of other values each that was tried has a
    place, in their order.

    Args:
        table: as `table` makes it.
        name: of the value.
        systems: a plot each.
        usual: each system's value in Figure 3, which a vertical line marks.
    """
    figure, panels = side_by_side(len(systems))
    for axes, system in zip(panels, systems, strict=True):
        _draw(axes, table, name, system, usual)
        axes.set(ylabel=LOSS_LABEL, title=named(system))
    return figure


@styled
def compared(
    tables: Mapping[str, pd.DataFrame],
    systems: Sequence[str] = tuple(SYSTEMS),
    usual: Mapping[str, Mapping[str, float]] = MappingProxyType({}),
) -> Figure:
    """Several ablations as `figure` draws each, a column each and a row for each system, whose losses share an axis.

    Args:
        tables: by the name of the value.
        systems: a row each.
        usual: by the same names, each system's value in Figure 3.
    """
    figure, panels = side_by_side(len(systems) * len(tables), len(tables))
    figure.set_size_inches(10.4, 3.3 * len(systems))
    for number, axes in enumerate(panels):
        row, column = divmod(number, len(tables))
        system, name = systems[row], list(tables)[column]
        if column and len(tables[name]):
            axes.sharey(panels[row * len(tables)])
        _draw(axes, tables[name], name, system, usual.get(name, EMPTY), legend=False)
        axes.set_title(named(system))
        axes.tick_params(labelleft=not column)
        if not column:
            axes.set_ylabel(LOSS_LABEL)
    legend_below(figure, panels)
    return figure


def _draw(
    axes: Axes,
    table: pd.DataFrame,
    name: str,
    system: str,
    usual: Mapping[str, float],
    legend: bool = True,
) -> None:
    """One system's lines of an ablation."""
    tried = sorted({*table.value, *usual.values()})
    place = {
        value: value if name == "p_expert" else float(number)
        for number, value in enumerate(tried)
    }
    mine = table[table.system == system]
    axes.set_xlabel(_AXES.get(name, name))
    lines = mine.groupby([one for one in ("novice_minutes", "method") if one in table])
    for number, ((minutes, *method), line) in enumerate(lines):
        ends = [
            (line["mean"] - line.minimum).clip(0),
            (line.maximum - line["mean"]).clip(0),
        ]
        words = ", ".join(
            [*(METHOD_STYLES[one]["label"] for one in method), f"{minutes:g} min"]
        )
        style = SIZE_STYLES[number % len(SIZE_STYLES)]
        if method:  # in its own colour
            size = sorted(mine.novice_minutes.unique()).index(minutes)
            style = size_style(method[0], size) | {
                "marker": METHOD_STYLES[method[0]]["marker"]
            }
        axes.errorbar(
            line.value.map(place), line["mean"], ends, capsize=3, label=words, **style
        )
    if len(mine) and system in usual:
        axes.axvline(
            place[usual[system]],
            color="0.6",
            linestyle=":",
            marker="",
            zorder=0,
            label="as in Figure 3",
        )
    finish(axes, legend=legend)
    if len(mine) and name == "p_expert":
        axes.set_xlim(-0.03, 1.03)
    elif len(mine):
        axes.set_xticks(list(place.values()), [f"{value:,.0f}" for value in place])
        axes.set_xlim(-0.3, len(place) - 0.7)
