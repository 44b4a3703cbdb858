"""Ablations of the paper's advice: one setting of SIDM's training changed at a time.

They run on small novice datasets; `most_data` runs on the largest.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.figures.curves import size_style
from companion.figures.style import (
    LOSS_LABEL,
    METHOD_STYLES,
    SIZE_STYLES,
    legend_below,
    system_label,
)
from companion.methods import CHOICES, COMPARED, LONG_PATIENCE, METHODS
from companion.presets import Preset
from companion.statistics.pairs import POINT, interval_texts, paired_comparison
from companion.statistics.tables import loss_summary
from companion.studies.reproduction import with_repeats
from companion.study import Study
from companion.trials import Trial
from ownrobot.plots import finish, side_by_side, styled
from sidm.config import ConfigError, replace
from sidm.shards import trajectories_for
from sidm.systems import PAPER_SYSTEMS

#: Iterations of a phase, fields of the training -> the numbers that are tried.
ITERATIONS = {
    "prediction_iterations": (20, 100, 500),
    "discriminator_iterations": (5, 20, 100),
    "matching_iterations": (0, 5, 20, 100),
}
#: Ablated setting -> its values. A p_e of None stands for 'proportional to the data'.
#: The paper's maps have 300 pixels on each side, the released code's 64; the patience
#: is in samples without a new minimum of the test loss.
VALUES: dict[str, tuple[Any, ...]] = {
    "p_expert": (0.0, 0.25, 0.5, 0.75, 0.9, None),
    **ITERATIONS,
    "pixels": (16, 32, 64),
    "patience": (50_000, 150_000, 450_000),
}

#: Settings that both of the paper's methods have.
OF_BOTH = ("pixels", "patience")

#: p_e for the largest novice dataset; section 5 advises less than for small ones.
MOST_DATA_P_EXPERT = 0.25


def most_data(study: Study, system: str) -> dict[str, list[Trial]]:
    """Trials on the largest novice dataset, by the description of each change of SIDM.

    Section 5 advises that the expert and the adversary count for less there. Patience
    is tried too because it counts the samples of both systems: at a p_e of 0.75 only a
    quarter of them are the novice's.
    """
    sizes = [max(study.preset.novice_minutes(system))]
    sidm = study.preset.training_of(METHODS["sidm"], system)
    less_expert = replace(sidm, p_expert=MOST_DATA_P_EXPERT)
    no_adversary = METHODS["no_regularisation"].label
    patient = study.changed(**CHOICES[LONG_PATIENCE][0])
    return {
        f"p_e of {MOST_DATA_P_EXPERT:g}": study.points(
            system, ["sidm"], sizes, less_expert
        ),
        no_adversary: study.points(system, ["no_regularisation"], sizes),
        LONG_PATIENCE: patient.points(system, ["sidm"], sizes),
    }


def most_data_trials(study: Study, system: str) -> list[Trial]:
    """All trials of `most_data`."""
    return [trial for trials in most_data(study, system).values() for trial in trials]


def proportional(preset: Preset, minutes: float) -> float:
    """The p_e proportional to the dataset sizes, which the paper advises against.

    It is the expert's share of all trajectories, rounded to six digits.
    """
    expert, novice = trajectories_for(preset.expert_minutes), trajectories_for(minutes)
    return round(expert / (expert + novice), 6)


def ablation(
    study: Study,
    system: str,
    name: str,
    values: Iterable[Any] | None = None,
    sizes: Sequence[float] = (),
) -> list[Trial]:
    """Trials with a setting at each of some values: 'p_expert' or a key of VALUES.

    At a p_e of 0 there is no regularisation, so no expert data is used; None stands for
    the p_e that is `proportional`. 0 matching iterations mean training without
    regularisation; 0 iterations of another phase raise ConfigError. Settings OF_BOTH
    are those of both of the paper's methods. `sizes`, min of novice data, are those of
    the preset's ablations by default.
    """
    preset, trials = study.preset, []
    sizes, seeds = sizes or preset.ablation_minutes, preset.ablation_seeds
    values = VALUES[name] if values is None else list(values)
    if name in OF_BOTH:
        for value in values:
            changed = study.changed(**{name: value})
            trials += changed.points(system, COMPARED, sizes, seeds=seeds)
    elif name == "p_expert":
        sidm = preset.training_of(METHODS["sidm"], system)
        for minutes, value in itertools.product(sizes, values):
            p = proportional(preset, minutes) if value is None else value
            training = replace(sidm, p_expert=p, regularise=p > 0)
            method = "sidm" if p > 0 else "novice_only"
            trials += study.points(system, [method], [minutes], training, seeds)
    else:
        for value in values:
            if value == 0 and name != "matching_iterations":
                raise ConfigError(
                    f"{name} must be at least 1; "
                    "without an adversary there are 0 matching_iterations"
                )
            method = "sidm" if value > 0 else "no_regularisation"
            training = preset.training_of(METHODS[method], system)
            if value > 0:
                training = replace(training, **{name: value})
            trials += study.points(system, [method], sizes, training, seeds)
    return trials


p_expert = functools.partial(ablation, name="p_expert")
pixels = functools.partial(ablation, name="pixels")
patience = functools.partial(ablation, name="patience")


def phases(study: Study, system: str) -> list[Trial]:
    """The ablations of all three phases."""
    return [trial for name in ITERATIONS for trial in ablation(study, system, name)]


def usual(preset: Preset, system: str, name: str) -> float:
    """The value of an ablated setting with which Figure 3 trains an SIDM."""
    training = preset.training_of(METHODS["sidm"], system)
    return getattr(training if hasattr(training, name) else preset.network, name)


def with_usual(
    study: Study,
    system: str,
    name: str,
    values: Iterable[Any],
    sizes: Sequence[float] = (),
) -> list[Trial]:
    """The trials of `ablation`, with Figure 3's value for comparison, each once."""
    every = [*values, usual(study.preset, system, name)]
    trials = ablation(study, system, name, every, sizes)
    return list({trial.key: trial for trial in trials}.values())


def values_of(frame: pd.DataFrame, name: str) -> pd.Series:
    """The value of an ablated setting in each result."""
    if name == "matching_iterations":  # none without regularisation
        return frame[name].where(frame.regularise.astype(bool), 0)
    return frame[name]


def table(frame: pd.DataFrame, name: str, by_method: bool = False) -> pd.DataFrame:
    """Validation losses of an ablation by the ablated `value`.

    One row per `system`, `novice_minutes`, `method` if asked for, and `value`, with the
    number of `trials` and the `mean`, `minimum` and `maximum` of their losses. Else all
    trials with the same value are taken together.
    """
    return loss_summary(
        frame.assign(value=values_of(frame, name)),
        ["system", "novice_minutes", *(["method"] if by_method else []), "value"],
    )


def ratios(
    frame: pd.DataFrame, name: str, usual: Mapping[str, float], results: str | Path
) -> pd.DataFrame:
    """Losses at the values of an ablation, divided by those at Figure 3's.

    `usual` is each system's value in Figure 3. Its repeated trials in `results` stand
    in where others ran on motion that was simulated again. The table is made by
    `pairs.paired_comparison`: one row per system, size, `value`, and method where both
    have the setting.
    """
    value = values_of(frame, name).astype(float)
    is_usual = value == frame.system.map(usual).astype(float)
    valued, on = frame.assign(value=value), list(POINT)
    if name in OF_BOTH:
        on.append("method")
    reference = with_repeats(valued[is_usual], results)
    return paired_comparison(valued[~is_usual], reference, on, by=["value"])


def page_table(table: pd.DataFrame, ratios: pd.DataFrame) -> pd.DataFrame:
    """The losses of `table`, and their `ratios` to those at Figure 3's value, as texts.

    Rows at Figure 3's value, or without a pair, have a dash for the ratio.
    """
    keys = [key for key in (*POINT, "method", "value") if key in table]
    ends = ["ratio", "low", "high"]
    rows = table.merge(ratios[[*keys, *ends]].astype(table[keys].dtypes), "left", keys)
    page = rows[[key for key in ("system", "method") if key in rows]]
    if "method" in page:
        page = page.assign(method=[METHODS[name].label for name in rows.method])
    spans = zip(rows.minimum, rows.maximum, strict=True)
    texts = {
        "value": [f"{round(value, 2):,g}" for value in rows.value],
        "seeds": rows.trials,
        "loss": rows["mean"].map("{:.3f}".format),
        "least to greatest": [f"{low:.3f} to {high:.3f}" for low, high in spans],
        "ratio (95 % interval)": interval_texts(rows[ends]),
    }
    return page.assign(**texts)


#: Ablated setting -> label of its axis.
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
    tables: Mapping[str, pd.DataFrame],
    systems: Sequence[str] = PAPER_SYSTEMS,
    usual: Mapping[str, Mapping[str, float]] = MappingProxyType({}),
) -> Figure:
    """Validation loss against ablated settings, one line per size and method.

    Each setting, with its `table`, has a column of plots, each system a row, which
    shares the loss axis. Lines are means over seeds; bars reach from the minimum to the
    maximum. Values of p_e have a linear axis; the values of other settings stand at
    equal distances. A vertical line marks a system's `usual` value, that of Figure 3.
    """
    names = list(tables)
    figure, panels = side_by_side(len(systems) * len(names), len(names))
    for number, axes in enumerate(panels):
        row, column = divmod(number, len(names))
        system, name = systems[row], names[column]
        if column and len(tables[name]):
            axes.sharey(panels[row * len(names)])
        _draw(axes, tables[name], name, system, usual.get(name, {}))
        axes.set_title(system_label(system))
        axes.tick_params(labelleft=not column)
        if not column:
            axes.set_ylabel(LOSS_LABEL)
    legend_below(figure, panels)
    return figure


def _draw(
    axes: Axes, table: pd.DataFrame, name: str, system: str, usual: Mapping[str, float]
) -> None:
    values = sorted({*table.value, *usual.values()})
    x = {
        value: value if name == "p_expert" else float(number)
        for number, value in enumerate(values)
    }
    rows = table[table.system == system]
    axes.set_xlabel(_AXES.get(name, name))
    groups = [column for column in ("novice_minutes", "method") if column in table]
    for number, ((minutes, *method), line) in enumerate(rows.groupby(groups)):
        below, above = line["mean"] - line.minimum, line.maximum - line["mean"]
        style, label = SIZE_STYLES[number % len(SIZE_STYLES)], f"{minutes:g} min"
        if method:  # the method's colour, and a line style for the size
            size = sorted(rows.novice_minutes.unique()).index(minutes)
            look = METHOD_STYLES[method[0]]
            style = size_style(method[0], size) | {"marker": look["marker"]}
            label = f"{look['label']}, {label}"
        axes.errorbar(
            line.value.map(x),
            line["mean"],
            [below.clip(0), above.clip(0)],
            capsize=3,
            label=label,
            **style,
        )
    if len(rows) and system in usual:
        look = {"color": "0.6", "linestyle": ":", "marker": "", "zorder": 0}
        axes.axvline(x[usual[system]], label="as in Figure 3", **look)
    finish(axes, legend=False)
    if len(rows) and name == "p_expert":
        axes.set_xlim(-0.03, 1.03)
    elif len(rows):
        axes.set_xticks(list(x.values()), [f"{value:,.0f}" for value in x])
        axes.set_xlim(-0.3, len(x) - 0.7)
