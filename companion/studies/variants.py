"""Variants of the methods: which need half the novice data of SIDM and fine-tuning?

Where curves are flat, a ratio of data says little with few seeds: a small step of the
loss is a long way along the curve. Losses at sizes that were run can be compared seed
by seed: the losses of one method with those of the others at twice its data or more.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from companion.methods import MIRRORED, VARIANTS
from companion.statistics.intervals import FEWEST_SEEDS
from companion.statistics.pairs import page_table, paired_comparison
from companion.study import Study
from companion.trials import Trial

#: The paper's method and its strongest rival.
AGAINST = ("sidm", "pretrain_finetune")
HALF, EQUAL = 2.0, 1.0  # least data of the others, as a multiple of the method's
#: What is added to a method -> the method with it, and the one without.
PARTS = {
    "least squares in place of fine-tuning": ("corrected", "pretrain_finetune"),
    "the same, both with mirror images": ("corrected_mirrored", "mirrored"),
    "mirror images": ("corrected_mirrored", "corrected"),
    "averaged weights of the expert's model": (
        "corrected_averaged",
        "corrected_mirrored",
    ),
    "the expert's model beneath them, both with mirror images": (
        "corrected_mirrored",
        "least_squares_mirrored",
    ),
}


def trials(study: Study, system: str) -> list[Trial]:
    """The variants and the methods that they are compared with, on small datasets.

    The methods of AGAINST have Figure 3's datasets too.
    """
    methods = (*AGAINST, *VARIANTS, "least_squares", *MIRRORED)
    trials = study.points(system, methods, study.preset.variant_minutes)
    trials += study.points(system, AGAINST, study.preset.novice_minutes(system))
    return list({trial.key: trial for trial in trials}.values())


def correction(study: Study, system: str) -> list[Trial]:
    """The trials about least squares on the expert's model, its parts and rivals."""
    parts = ("mirrored", "corrected", "corrected_mirrored", "corrected_averaged")
    methods = (*AGAINST, "least_squares", "least_squares_mirrored", *parts)
    return [trial for trial in trials(study, system) if trial.method in methods]


def table(
    frame: pd.DataFrame,
    methods: Sequence[str],
    against: Sequence[str] = AGAINST,
    times: float = HALF,
    value: str = "validation_loss",
) -> pd.DataFrame:
    """Ratios of methods' losses to those of others that have more data.

    Each other method is at the smallest of its sizes, `with_minutes`, that is `times`
    the method's data or more; EQUAL for the same amount. The table is made by
    `pairs.paired_comparison`, one row per system, method, size and other method
    (`against`), where at least FEWEST_SEEDS seeds were run.
    """
    empty = paired_comparison(frame[:0], frame[:0])
    parts = [empty.assign(against="", with_minutes=0.0)]
    points = frame[frame.method.isin(methods)].groupby(
        ["system", "method", "novice_minutes"]
    )
    for (system, _, minutes), losses in points:
        enough = frame[
            (frame.system == system) & (frame.novice_minutes >= times * minutes)
        ]
        for other in against:
            rows = enough[enough.method == other]
            size = rows.novice_minutes.min()
            nearest = rows[rows.novice_minutes == size].assign(novice_minutes=minutes)
            compared = paired_comparison(losses, nearest, value=value)
            parts.append(compared.assign(against=other, with_minutes=size))
    compared = pd.concat(parts, ignore_index=True)
    return compared[compared.seeds >= FEWEST_SEEDS].reset_index(drop=True)


def parts(frame: pd.DataFrame) -> pd.DataFrame:
    """What each of PARTS does to the losses of one step and the errors of 25.

    A table for a page: the ratios with their intervals by part, system and size.
    """
    frame = frame.assign(error=frame.position_error.str[-1].astype(float))
    values = {
        "validation_loss": "ratio of the losses",
        "error": "of the errors after 2.5 s",
    }
    tables = []
    for added, (method, other) in PARTS.items():
        texts = {}
        for value, name in values.items():
            compared = table(frame, [method], [other], EQUAL, value)
            compared = compared[compared.with_minutes == compared.novice_minutes]
            texts[name] = page_table(compared)["ratio (95 % interval)"]
        point = compared[["system", "novice_minutes"]]
        point.insert(0, "what is added", added)
        tables.append(point.assign(**texts))
    shown = pd.concat(tables, ignore_index=True)
    return shown.rename(columns={"novice_minutes": "novice data (min)"})


def by_method(table: pd.DataFrame, points: int) -> pd.DataFrame:
    """In how many comparisons each method is better, and whether it always is.

    `points` is the number of systems and sizes at which a method has to be compared
    with each other method. One row per method: '8 of 8' for each of AGAINST, counted by
    the whole interval, and under `half` 'yes', 'no', or 'not all run'.
    """
    groups = table.assign(better=table.high < 1).groupby(
        ["method", "against"], sort=False
    )
    counts = groups.better.agg(["sum", "size"])
    texts = counts["sum"].astype(str) + " of " + counts["size"].astype(str)
    rows = texts.unstack().reindex(columns=list(AGAINST))
    won = (counts["sum"] == counts["size"]).groupby("method").all()
    whole = (counts["size"] == points).groupby("method").sum() == len(AGAINST)
    won, whole = won.reindex(rows.index), whole.reindex(rows.index)
    rows["half"] = np.select([~won, whole], ["no", "yes"], "not all run")
    return rows.reset_index()
