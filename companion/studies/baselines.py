"""SIDM among other methods: what each reaches on the same novice data, and its cost."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from companion.figures.dots import dot_plot
from companion.figures.style import system_label
from companion.methods import BASELINES, COMPARED, FIGURE3, METHODS
from companion.statistics.pairs import interval_texts, paired_comparison
from companion.studies.reproduction import with_repeats
from companion.studies.throughput import seconds
from companion.study import Study
from companion.trials import Trial
from sidm.systems import PAPER_SYSTEMS

POINT = ["system", "novice_minutes", "method"]
ENDS, ENDINGS = ["ratio", "low", "high"], ["", "_low", "_high"]
#: Column of the ratio to each of the paper's methods, on a page.
RATIOS = {"sidm": "to SIDM's (95 % interval)", "novice_only": "to that without SIDM"}
#: Headings of the figure -> methods below it, with the names of their rows.
GROUPS = {
    "without the expert": {
        "novice_only": "without SIDM",
        "least_squares": "least squares",
    },
    "the expert's weights": {
        "pretrain_finetune": "fine-tuned",
        "finetune_parts": "encoder, decoder fine-tuned",
        "residual": "corrected by a network",
        "expert_only": "as they are",
    },
    "joint training": {
        "pooled": "all weights shared",
        "pooled_flag": "with a system flag",
    },
    "SIDM, other matching": {
        "no_regularisation": "none",
        "strong_matching": "100 iterations",
        "mmd": "MMD",
        "coral": "CORAL",
        "gradient_reversal": "gradient reversal",
    },
}


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
    paces: Mapping[str, float] | None = None,
) -> pd.DataFrame:
    """Losses and costs of each method, one row per system, size and method.

    Losses are divided on one motion, where the paper's method was repeated on the
    other's. Two results of one point raise ValueError.

    Returns:
        Rows in the order of METHODS: `seeds`; mean `loss`, `lowest` and `highest`; mean
        `samples` of prediction and pretraining; mean `minutes` of one core, from the
        method's pace, or else as long as the trials took; and the ratio of the loss to
        that of each of the paper's methods: `to_sidm`, `to_sidm_low` and so on.
    """
    frame = frame.assign(
        samples=frame.samples + frame.pretraining_samples,
        minutes=seconds(frame, paces or {}).fillna(frame.seconds) / 60,
    )
    losses = frame.groupby(POINT, sort=False)
    means = losses.agg(
        seeds=("seed", "size"),
        loss=("validation_loss", "mean"),
        lowest=("validation_loss", "min"),
        highest=("validation_loss", "max"),
        samples=("samples", "mean"),
        minutes=("minutes", "mean"),
    ).reset_index()
    for paper in COMPARED:
        rest, reference = frame[frame.method != paper], frame[frame.method == paper]
        names = dict(zip(ENDS, (f"to_{paper}{end}" for end in ENDINGS), strict=True))
        ratios = paired_comparison(rest, with_repeats(reference, results))
        ratios = ratios[[*POINT, *ENDS]].rename(columns=names)
        means = means.merge(ratios, how="left", on=POINT)
    place = {name: number for number, name in enumerate(METHODS)}
    return means.sort_values(
        POINT, key=lambda column: column.map(lambda value: place.get(value, value))
    )


def page_tables(table: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """A title and a table of texts for each system and size of `table`."""
    for (system, minutes), rows in table.groupby(["system", "novice_minutes"]):
        texts = {
            "method": [METHODS[name].label for name in rows.method],
            "seeds": rows.seeds.tolist(),
            "loss": [f"{loss:.3f}" for loss in rows.loss],
        }
        for other, name in RATIOS.items():
            ends = rows[[f"to_{other}{end}" for end in ENDINGS]]
            texts[name] = interval_texts(ends)
        texts["samples"] = [f"{count:,.0f}" for count in rows.samples]
        texts["minutes"] = [f"{spent:.1f}" for spent in rows.minutes]
        title = f"{system_label(system)}, {minutes:g} min of novice data"
        yield title, pd.DataFrame(texts)


def figure(
    table: pd.DataFrame, minutes: float, systems: Sequence[str] = PAPER_SYSTEMS
) -> Figure:
    """Each method's loss divided by the SIDM's, with its interval, as labelled dots.

    `table` is made by `table`; shown are rows with so many `minutes` of novice data.
    """
    table = table[(table.novice_minutes == minutes) & table.to_sidm.notna()]
    rows = [
        (system_label(system), row, group, name, *ends)
        for group, names in _rows(set(table.method)).items()
        for name, row in names.items()
        for system in systems
        for ends in table.loc[
            (table.system == system) & (table.method == name),
            ["to_sidm", "to_sidm_low", "to_sidm_high"],
        ].itertuples(index=False)
    ]
    names = ["panel", "row", "group", "method", "value", "low", "high"]
    dots = pd.DataFrame(rows, columns=names)
    return dot_plot(dots, "loss / that with SIDM", ticks=(0.5, 0.7, 1.0, 1.5, 2.0, 3.0))


def _rows(methods: set[str]) -> dict[str, dict[str, str]]:
    """GROUPS, and a group of the methods that are in none."""
    known = {name for names in GROUPS.values() for name in names}
    others = [name for name in METHODS if name in methods - known - {"sidm"}]
    return GROUPS | {"further methods": {n: METHODS[n].label for n in others}}
