"""The verdicts of the decisive experiment, by rules that were written before its trainings.

The page on claims has the rules. Seeds pair the methods; data ratios are those of
`statistics.data_ratio`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from companion.engine.store import Results
from companion.statistics.claims import (
    CONTRARY,
    DIRECTION,
    NO_VERDICT,
    NOT_SEEN,
    REPRODUCED,
)
from companion.statistics.data_ratio import Saving, data_ratio
from companion.statistics.intervals import FEWEST_SEEDS, Interval, mean_ratio
from companion.statistics.stopping_rules import RULES, kept_by
from companion.studies.decisive.design import ALL_SEEDS, FINETUNING, RECIPES, arm
from companion.study import Study
from sidm.systems import SYSTEMS

AT = 5.0  # min of novice data at which data ratios are judged
SMALL = (1.0, 5.0)  # min at which losses are compared
ALONE_SIZES = (1.0, 5.0, 20.0, 60.0, 120.0)  # min of training alone
PAPER = {"system1": 20.0, "system2": 5.0}  # times less data
RELEASED, END = "the released code's", "the end"

#: Verdict on data ratios -> recipe, stopping rule, methods.
RATIOS: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "R1": ("R", RELEASED, ("sidm",)),
    "R2": ("R", END, ("sidm",)),
    "T1": ("T", RELEASED, ("sidm", FINETUNING)),
    "T2": ("T", END, ("sidm", FINETUNING)),
}
#: Recipe -> the rule by which verdict S compares its losses.
LOSSES = {"R": RELEASED, "T": END}
#: Losses hold claims that they are smaller; data ratios, that they are larger.
COLUMNS = (
    "verdict",
    "system",
    "recipe",
    "rule",
    "method",
    "minutes",
    "seeds",
    "value",
    "low",
    "high",
    "says",
)


def results(study: Study, store: Results) -> pd.DataFrame:
    """The stored trainings of both recipes on both systems, of up to ten seeds, with their `recipe`."""
    parts = [
        store.frame(arm(study, recipe, system, caps, ALL_SEEDS)).assign(recipe=recipe)
        for recipe, caps in RECIPES.items()
        for system in SYSTEMS
    ]
    return pd.concat(parts)


def losses_by(frame: pd.DataFrame, rule: str) -> pd.DataFrame:
    """`results` with the `loss` that a rule keeps: on all validation motion at the end, else on what every test has."""
    found = kept_by(frame, RULES[rule])
    return found.assign(
        loss=found.validation_loss if rule == END else found.kept_validation
    )


def judge(
    found: Saving | Interval, paper: float | None = None, above: bool = True
) -> str:
    """What an interval says of a claim that a ratio lies above 1, or below, and at the paper's number."""
    if np.isnan([found.low, found.high]).any():
        return NO_VERDICT
    side = (1 if found.low > 1 else -1 if found.high < 1 else 0) * (1 if above else -1)
    if side == 1 and paper is not None and found.low <= paper <= found.high:
        return REPRODUCED
    return {1: DIRECTION, 0: NOT_SEEN, -1: CONTRARY}[side]


def wide(frame: pd.DataFrame, method: str, sizes: Sequence[float]) -> pd.DataFrame:
    """Losses of a method, a line a seed that has all sizes, a column a size."""
    own = frame[frame.method == method].pivot(
        index="seed", columns="novice_minutes", values="loss"
    )
    return own.reindex(columns=list(sizes)).dropna()


def ratio_of_data(frame: pd.DataFrame, method: str) -> tuple[int, float, float, float]:
    """Seeds, and the data ratio of a method at AT with its ends, from one recipe's losses on one system."""
    alone, mine = wide(frame, "novice_only", ALONE_SIZES), wide(frame, method, [AT])
    seeds = alone.index.intersection(mine.index)
    found = data_ratio(
        ALONE_SIZES, alone.loc[seeds].to_numpy(), mine.loc[seeds, AT].to_numpy(), AT
    )
    return len(seeds), *found


def loss_ratio(frame: pd.DataFrame, minutes: float) -> tuple[int, float, float, float]:
    """Seeds, and the SIDM's loss by that of training alone with its ends, from one recipe's losses on one system."""
    sidm, alone = (wide(frame, method, [minutes]) for method in ("sidm", "novice_only"))
    seeds = sidm.index.intersection(alone.index)
    if len(seeds) < FEWEST_SEEDS:
        return len(seeds), np.nan, np.nan, np.nan
    return len(seeds), *mean_ratio(
        sidm.loc[seeds].to_numpy(), alone.loc[seeds].to_numpy()
    )


def data_ratios(frame: pd.DataFrame) -> pd.DataFrame:
    """Verdicts R1, R2, T1 and T2 of stored `results`: a line a verdict, system and method."""
    lines = []
    for name, (recipe, rule, methods) in RATIOS.items():
        for system in SYSTEMS:
            own = losses_by(
                frame[(frame.recipe == recipe) & (frame.system == system)], rule
            )
            for method in methods:
                seeds, *found = ratio_of_data(own, method)
                says = judge(
                    Saving(*found), PAPER[system] if method == "sidm" else None
                )
                lines.append(
                    (name, system, recipe, rule, method, AT, seeds, *found, says)
                )
    return pd.DataFrame(lines, columns=list(COLUMNS))


def small_data(frame: pd.DataFrame) -> pd.DataFrame:
    """Verdict S of stored `results`: the SIDM's loss by that of training alone, paired by seed, with little data."""
    lines = []
    for recipe, rule in LOSSES.items():
        for system in SYSTEMS:
            own = losses_by(
                frame[(frame.recipe == recipe) & (frame.system == system)], rule
            )
            for minutes in SMALL:
                seeds, *found = loss_ratio(own, minutes)
                says = judge(Interval(*found), above=False)
                lines.append(
                    ("S", system, recipe, rule, "sidm", minutes, seeds, *found, says)
                )
    return pd.DataFrame(lines, columns=list(COLUMNS))


def verdicts(frame: pd.DataFrame) -> pd.DataFrame:
    """All verdicts of stored `results`."""
    return pd.concat([data_ratios(frame), small_data(frame)], ignore_index=True)
