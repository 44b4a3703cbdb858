"""Tables of the chapter on Figure 3: losses, savings, sizes and hours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from companion.engine.store import Results
from companion.figures.style import METHOD_STYLES, system_label
from companion.grids import figure_costs
from companion.methods import COMPARED, FOR_LITTLE
from companion.presets import Preset
from companion.statistics.pairs import paired_comparison
from companion.statistics.savings import ratio_texts
from companion.statistics.tables import component_errors, loss_summary, wide
from companion.studies.duration import LONG
from companion.studies.tuning import best_novice_only
from companion.study import Study
from sidm.systems import PAPER_SYSTEMS

POINT = ["system", "novice_minutes", "method"]
#: Column of `figure_costs` -> heading.
HOURS = {
    "figure": "`--figure`",
    "stored": "trials stored",
    "resumed": "resumed",
    "hours": "hours of one processor or GPU",
    "peak_memory": "peak memory (MiB)",
    "devices": "on",
}


def losses(frame: pd.DataFrame, systems: Sequence[str]) -> pd.DataFrame:
    """Losses as texts, mean (smallest, largest): a row a size, a column a method."""
    means = loss_summary(frame, POINT)
    columns = means[["mean", "minimum", "maximum"]].itertuples(index=False)
    texts = ["{:.3f} ({:.2f}, {:.2f})".format(*line) for line in columns]
    return _by_method(means.assign(text=texts), systems)


def savings(table: pd.DataFrame, systems: Sequence[str]) -> pd.DataFrame:
    """A table of `statistics.savings` as texts: a row a size, a column a method."""
    return _by_method(table.assign(text=ratio_texts(table)), systems)


def little_data(
    frame: pd.DataFrame, little: pd.DataFrame, saved: pd.DataFrame
) -> pd.DataFrame:
    """Losses of an SIDM tuned for little data beside others', on the same seeds.

    A row per pair of robots and size, with the data that the SIDM saves. `little` is
    made by `tuning.little_data_results`; `saved`, by `statistics.savings`, has the
    SIDM's own.
    """
    tuned = little[little.method == "sidm" + FOR_LITTLE]
    others = {
        "without SIDM, so tuned": best_novice_only(frame, little),
        "with SIDM, as in Figure 3": frame[frame.method == "sidm"],
        "with SIDM, so tuned": tuned,
    }
    columns = {
        name: paired_comparison(tuned, other).set_index(POINT[:2]).reference
        for name, other in others.items()
    }
    saved = saved[saved.method == "sidm" + FOR_LITTLE]
    times = saved.assign(times=ratio_texts(saved)).set_index(POINT[:2]).times
    table = pd.DataFrame(columns | {"data saved (times)": times})
    return table.rename_axis(["system", "novice data (min)"]).reset_index()


def _by_method(table: pd.DataFrame, systems: Sequence[str]) -> pd.DataFrame:
    """The texts of a table by pair and size, a column a method; both in their order."""
    place = {name: number for number, name in enumerate([*systems, *METHOD_STYLES])}
    ordered = table.sort_values(
        POINT, key=lambda column: column.map(lambda value: place.get(value, value))
    )
    shown = ordered.assign(
        method=ordered.method.map(lambda name: METHOD_STYLES[name]["label"]),
        pair=ordered.system.map(system_label),
    )
    shown = shown.rename(columns={"novice_minutes": "novice data (min)"})
    return wide(shown, ["pair", "novice data (min)"], "method", "text")


def sizes(presets: Mapping[str, Preset], systems: Sequence[str]) -> pd.DataFrame:
    """Sizes of presets side by side: a row a size, a column a preset."""
    columns = {f"`{name}`": _sizes(preset, systems) for name, preset in presets.items()}
    table = pd.DataFrame(columns, dtype=object)
    return table.rename_axis("preset").reset_index()


def _sizes(preset: Preset, systems: Sequence[str]) -> dict[str, object]:
    novice = {
        f"novice data, {system_label(name)} (min)": ", ".join(
            f"{minutes:g}" for minutes in preset.novice_minutes(name)
        )
        for name in systems
    }
    p_expert = {
        f"$p_e$, {system_label(name)}": preset.p_expert(name) for name in systems
    }
    return {
        "expert data (min)": f"{preset.expert_minutes:.3g}",
        **novice,
        **p_expert,
        "validation data (min)": f"{preset.validation_minutes:g}",
        "trials a point": preset.seeds,
        "trials with 1 and 5 min": preset.seeds_at(5),
        "trials of Figure 3": _trials(Study(preset)),
        "height map (pixels a side)": preset.network.pixels,
        "LSTM layers": f"{preset.network.layers} x {preset.network.hidden}",
        "initial weights": preset.network.initialisation,
        "samples a trial, at most": f"{preset.training.max_samples:,}",
        "patience (samples)": f"{preset.training.patience:,}",
    }


def _trials(study: Study) -> int:
    return sum(len(study.figure3(name)) for name in PAPER_SYSTEMS)


def components(frame: pd.DataFrame, system: str) -> pd.DataFrame:
    """Errors of the 13 components with the least and the most novice data.

    The last line is the angular velocities' share of the loss. There is a column per
    size and method; no rows where no size has both methods.
    """
    trained = frame[(frame.system == system) & frame.method.isin(COMPARED)]
    methods = trained.groupby("novice_minutes").method.nunique()
    full = methods.index[methods == len(COMPARED)]  # sizes with both methods
    ends = trained[trained.novice_minutes.isin([*full[:1], *full[-1:]])]
    losses = {
        f"{size:g} min, {METHOD_STYLES[name]['label']}": group.component_losses.tolist()
        for (size, name), group in ends.groupby(["novice_minutes", "method"])
    }
    if not losses:
        return pd.DataFrame()
    means = [np.mean(values, axis=0) for values in losses.values()]
    shares = (f"{mean[10:].sum() / mean.sum():.0%}" for mean in means)
    # The table has numbers, and percentages in its last line.
    table = component_errors(losses).astype(object)
    table.loc[len(table)] = ["angular velocities' share of the loss", "-", *shares]
    return table


def hours(study: Study, store: Results) -> pd.DataFrame:
    """What the figures of a preset cost, with the headings of a page."""
    table = figure_costs(study, store)
    table["stored"] = [f"{line.stored} of {line.trials}" for line in table.itertuples()]
    table["peak_memory"] = [round(memory) for memory in table.peak_memory]
    table["devices"] = [", ".join(devices) or "-" for devices in table.devices]
    return table[[*HOURS]].rename(columns=HOURS)


def not_run(frame: pd.DataFrame, study: Study, systems: Sequence[str]) -> pd.DataFrame:
    """Studies that would be longer or larger, and their hours at the stored pace."""
    samples = frame.samples + frame.pretraining_samples
    pace = (frame.seconds / samples).median()  # s a sample, of one processor
    ours = sum(len(study.figure3(name)) for name in systems)
    papers = _trials(Study("released"))
    larger = "the paper's sizes, up to 10 and 5 h, and ten trials a point"
    lines = [
        ("Figure 3 with the patience of the long trainings", ours, LONG["max_samples"]),
        (f"{larger}; networks as here", papers, study.preset.training.max_samples),
    ]
    columns = ["not run", "trainings", "samples each, at most"]
    table = pd.DataFrame(lines, columns=columns)
    work = table["trainings"] * table["samples each, at most"]
    return table.assign(**{"hours of one processor, at most": work * pace / 3600})
