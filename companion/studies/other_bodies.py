"""Pairs of robots that see or act differently: what SIDM saves for them.

The expert is the paper's expert of system 1. The novice is the same robot in the same
motion as the paper's novice, but has another body: other observations or actions. So
the expert's weights cannot all be copied.
"""

from __future__ import annotations

import pandas as pd

from companion.bodies import NOVICES
from companion.figures.style import METHOD_LABELS
from companion.methods import ANY_BODIES
from companion.statistics.pairs import page_table, paired_comparison
from companion.statistics.tables import wide
from companion.study import Study
from companion.trials import Trial


def trials(study: Study, system: str) -> list[Trial]:
    """The methods that can learn from a pair of different bodies, for each novice."""
    preset, trials = study.preset, []
    for body in NOVICES.values():
        novice = study.changed(novice_body=body)
        sizes = preset.other_body_minutes
        trials += novice.points(system, ANY_BODIES, sizes, seeds=preset.seeds)
    return trials


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """Ratios of SIDM's losses to those of the other methods; below 1 SIDM is better.

    The table is made by `pairs.paired_comparison`, one row per novice, size and other
    method, which is in the column `against`.
    """
    point = ["system", "novice_body", "novice_minutes"]
    sidm, parts = frame[frame.method == "sidm"], []
    for other in ANY_BODIES:
        if other != "sidm":
            compared = paired_comparison(sidm, frame[frame.method == other], on=point)
            parts.append(compared.assign(against=other))
    return pd.concat(parts, ignore_index=True)


def for_page(table: pd.DataFrame) -> pd.DataFrame:
    """A table made by `table` as a page shows it: a column for each size."""
    shown = page_table(table, 2, novice_body="novice")
    shown["minutes"] = [f"with {m:g} min" for m in table.novice_minutes]
    shown["loss by that of"] = table.against.map(METHOD_LABELS)
    keys = ["novice", "loss by that of"]
    return wide(shown, keys, "minutes", "ratio (95 % interval)")
