"""What might need less novice data than the paper's method and its strongest neighbour, and whether it needs half.

Where curves are flat, a ratio of data says little with few seeds: a small step of the
loss is a long way along the curve. Losses at sizes that were run can be held against
each other seed by seed: those of a method beside those of the others with twice its
data and more.
"""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from companion.methods import MIRRORED, VARIANTS
from companion.statistics.intervals import FEWEST_SEEDS
from companion.statistics.pairs import beside
from companion.study import Study
from companion.trials import Trial

#: the paper's method and its strongest neighbour
AGAINST = ("sidm", "pretrain_finetune")
HALF, EQUAL = 2.0, 1.0  # times the data that the others have at least


def trials(study: Study, system: str) -> list[Trial]:
    """The variants on small datasets, beside the methods that they are to beat; those on Figure 3's too."""
    found = study.points(
        system,
        (*AGAINST, *VARIANTS, "least_squares", *MIRRORED),
        study.preset.variant_minutes,
    )
    found += study.points(system, AGAINST, study.preset.novice_minutes(system))
    return list({trial.key: trial for trial in found}.values())


def correction(study: Study, system: str) -> list[Trial]:
    """Of these, least squares on the expert's model, what it is made of, and what it is to beat."""
    parts = ("mirrored", "corrected", "corrected_mirrored", "corrected_averaged")
    kept = (*AGAINST, "least_squares", "least_squares_mirrored", *parts)
    return [trial for trial in trials(study, system) if trial.method in kept]


def table(
    frame: pd.DataFrame,
    methods: Sequence[str],
    against: Sequence[str] = AGAINST,
    times: float = HALF,
    value: str = "validation_loss",
) -> pd.DataFrame:
    """Methods beside others that have at least so many times their data: `pairs.beside`, of FEWEST_SEEDS or more.

    Args:
        frame: of stored results, at most one a system, method, size and seed.
        methods: that have less data.
        against: the others; each at the smallest of its sizes that is large enough,
            `with_minutes`.
        times: how many times a method's data they have, or more; EQUAL for the same.
        value: the column that is compared.
    """
    parts = [beside(frame[:0], frame[:0]).assign(against="", with_minutes=0.0)]
    for (system, _, minutes), own in frame[frame.method.isin(methods)].groupby(
        ["system", "method", "novice_minutes"]
    ):
        for other in against:
            its = frame[
                (frame.system == system)
                & (frame.method == other)
                & (frame.novice_minutes >= times * minutes)
            ]
            nearest = its[its.novice_minutes == its.novice_minutes.min()].assign(
                novice_minutes=minutes
            )
            found = beside(own, nearest, value=value)
            parts.append(
                found.assign(against=other, with_minutes=its.novice_minutes.min())
            )
    every = pd.concat(parts, ignore_index=True)
    return every[every.seeds >= FEWEST_SEEDS].reset_index(drop=True)


def by_method(table: pd.DataFrame, points: int) -> pd.DataFrame:
    """A line a method: in how many of its comparisons with each other it is better, and whether it always is.

    Args:
        table: of `table`, all systems.
        points: systems and sizes at which a method has to have been held against each
            other.

    Returns:
        '8 of 8' for each of AGAINST, by the whole interval, and under `half` 'yes',
        'no', or 'not all run'.
    """
    sure = (
        table.assign(sure=table.high < 1)
        .groupby(["method", "against"], sort=False)
        .sure.agg(["sum", "size"])
    )
    words = sure["sum"].astype(str) + " of " + sure["size"].astype(str)
    found = words.unstack().reindex(columns=list(AGAINST))
    better, held = (
        sure[name].unstack(fill_value=0).reindex(columns=list(AGAINST), fill_value=0)
        for name in sure
    )
    always, whole = (better == held).all(axis=1), (held == points).all(axis=1)
    found["half"] = [
        "no" if not a else "yes" if w else "not all run"
        for a, w in zip(always, whole, strict=True)
    ]
    return found.reset_index()
