"""The verdicts of the decisive experiment, by rules written before its trainings.

The page on claims has the rules. Methods are compared seed by seed; data ratios are
those of `statistics.savings.data_ratio`.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pandas as pd

from companion.engine.store import Results
from companion.figures.style import system_label
from companion.statistics.claims import NO_VERDICT, NOT_SEEN, verdict
from companion.statistics.intervals import FEWEST_SEEDS, holm, mean_ratio, p_values
from companion.statistics.savings import DataRatio, data_ratio
from companion.statistics.stopping_rules import RULES, apply_rule
from companion.studies.decisive.arms import (
    ALL_SEEDS,
    FEW_SEEDS,
    FINETUNING,
    RECIPES,
    arm,
    restricted,
    rivals_decay,
)
from companion.study import Study
from ownrobot.comparison.statistics import Interval
from sidm.systems import PAPER_SYSTEMS

AT = 5.0  # min of novice data at which data ratios are judged
SMALL = (1.0, 5.0)  # min at which losses are compared
ALONE_SIZES = (1.0, 5.0, 20.0, 60.0, 120.0)  # min of training alone
PAPER = {"system1": 20.0, "system2": 5.0}  # times less data
RELEASED, END = "released", "end"  # stopping rules

#: Verdict on data ratios -> recipe, stopping rule, methods.
RATIOS: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "R1": ("R", RELEASED, ("sidm",)),
    "R2": ("R", END, ("sidm",)),
    "T1": ("T", RELEASED, ("sidm", FINETUNING)),
    "T2": ("T", END, ("sidm", FINETUNING)),
}
#: Recipe -> the rule by which verdict S compares its losses.
LOSSES = {"R": RELEASED, "T": END}
#: Columns of a table of verdicts.
ABOUT = ["verdict", "system", "recipe", "rule", "method", "minutes", "seeds"]
COLUMNS = [*ABOUT, "value", "low", "high", "bound", "says"]


def results(study: Study, store: Results) -> pd.DataFrame:
    """The stored trainings of both recipes on both systems, with their `recipe`.

    They have up to ten seeds.
    """
    parts = [
        store.frame(arm(study, recipe, system, caps, ALL_SEEDS), curves=True).assign(
            recipe=recipe
        )
        for recipe, caps in RECIPES.items()
        for system in PAPER_SYSTEMS
    ]
    # a part without rows has no types, and would take those of the others away
    return pd.concat([part for part in parts if len(part)] or parts)


def losses_by(frame: pd.DataFrame, rule: str) -> pd.DataFrame:
    """Results with the validation `loss` of the weights that a stopping rule keeps.

    The rule END is judged on all validation motion, other rules on the part of it that
    every test during training has.
    """
    kept = apply_rule(frame, RULES[rule])
    return kept.assign(
        loss=kept.validation_loss if rule == END else kept.kept_validation
    )


def losses_of(frame: pd.DataFrame, recipe: str, system: str, rule: str) -> pd.DataFrame:
    """The losses of one recipe on one system that a stopping rule keeps."""
    chosen = frame[(frame.recipe == recipe) & (frame.system == system)]
    return losses_by(chosen, rule)


def paired(
    frame: pd.DataFrame, method: str, minutes: float, alone: Sequence[float]
) -> tuple[np.ndarray, np.ndarray]:
    """Losses (S,) of a method, and (S, M) of training alone at M sizes, seed by seed.

    `frame` has the losses of one recipe on one system; seeds that lack one are left
    out.
    """
    wide = frame.pivot(
        index="seed", columns=["method", "novice_minutes"], values="loss"
    )
    columns = [(method, minutes), *(("novice_only", size) for size in alone)]
    both = wide.reindex(columns=columns).dropna().to_numpy(float)
    return both[:, 0], both[:, 1:]


def ratio_of_data(
    frame: pd.DataFrame, method: str, minutes: float = AT
) -> tuple[int, DataRatio]:
    """The data ratio of a method, and from how many seeds.

    `frame` has the losses of one recipe on one system, the method has so many `minutes`
    of novice data; verdicts are on AT alone. The curve of training alone ends at 20
    minutes where nothing longer is stored, as in step E3.
    """
    stored = set(frame[frame.method == "novice_only"].novice_minutes)
    sizes = ALONE_SIZES if stored & {*ALONE_SIZES[3:]} else ALONE_SIZES[:3]
    losses, alone = paired(frame, method, minutes, sizes)
    return len(losses), data_ratio(sizes, alone, losses, minutes)


def sidm_saving(
    frame: pd.DataFrame,
    recipe: str,
    system: str,
    rule: str,
    minutes: float,
    rival: str | None = None,
) -> DataRatio:
    """The SIDM's data ratio at any of its sizes, of `results`.

    `rival` is the recipe of training alone; by default the same.
    """
    losses = losses_of(frame, recipe, system, rule)
    if rival is not None:
        alone = losses_of(frame, rival, system, rule).query("method == 'novice_only'")
        losses = pd.concat([losses.query("method == 'sidm'"), alone])
    return ratio_of_data(losses, "sidm", minutes)[1]


def loss_ratio(frame: pd.DataFrame, minutes: float) -> tuple[int, float, float, float]:
    """The SIDM's loss / that of training alone: number of seeds, value, low and high.

    `frame` has the losses of one recipe on one system.
    """
    losses, alone = paired(frame, "sidm", minutes, [minutes])
    if len(losses) < FEWEST_SEEDS:
        return len(losses), np.nan, np.nan, np.nan
    return len(losses), *mean_ratio(losses[:, None], alone)


def data_ratios(frame: pd.DataFrame) -> pd.DataFrame:
    """Verdicts R1, R2, T1 and T2 of `results`: a row per verdict, system and method."""
    rows = []
    for (name, (recipe, rule, methods)), system in itertools.product(
        RATIOS.items(), PAPER_SYSTEMS
    ):
        losses = losses_of(frame, recipe, system, rule)
        for method in methods:
            seeds, ratio = ratio_of_data(losses, method)
            claimed = method == "sidm"  # the paper claims nothing of fine-tuning
            estimate = Interval(*ratio[:3])  # a bound has no value, and so no verdict
            says = verdict(estimate, 1.0, PAPER[system]) if claimed else NO_VERDICT
            about = name, system, recipe, rule, method, AT, seeds
            rows.append((*about, *ratio, says))
    return pd.DataFrame(rows, columns=COLUMNS)


def small_data(frame: pd.DataFrame) -> pd.DataFrame:
    """Verdict S of `results`: a row per recipe, system and size of little data.

    The value is the SIDM's loss divided by that of training alone, paired by seed; the
    claim is that it lies below 1.
    """
    rows = []
    for (recipe, rule), system in itertools.product(LOSSES.items(), PAPER_SYSTEMS):
        losses = losses_of(frame, recipe, system, rule)
        for minutes in SMALL:
            seeds, *ratio = loss_ratio(losses, minutes)
            says = verdict(Interval(*ratio), 1.0, above=False)
            about = "S", system, recipe, rule, "sidm", minutes, seeds
            rows.append((*about, *ratio, "", says))
    return pd.DataFrame(rows, columns=COLUMNS)


def with_rivals_decay(study: Study, store: Results) -> DataRatio:
    """The SIDM's loss with the rival's decay, step E2, over that of its rival in B1.

    Of the two draws the one with the lower mean smoothed test loss counts. Losses are
    those at the end, paired by seed.
    """
    trained = losses_by(store.frame(rivals_decay(study), curves=True), END)
    caps = restricted(RECIPES["T"], novice_only=(AT,))
    rivals = arm(study, "T", "system1", caps, FEW_SEEDS)
    alone = losses_by(store.frame(rivals, curves=True), END)
    tested = trained.groupby("weight_decay").kept_test.mean().sort_values()
    chosen = trained[trained.weight_decay.isin(tested.index[:1])]
    both = chosen.merge(alone, on="seed", suffixes=("", "_rival"))
    if len(both) < FEWEST_SEEDS:
        return DataRatio(np.nan, np.nan, np.nan)
    losses, others = (both[[name]].to_numpy() for name in ("loss", "loss_rival"))
    return DataRatio(*mean_ratio(losses, others), "")


def verdicts(frame: pd.DataFrame) -> pd.DataFrame:
    """All verdicts of `results`, with p-values `corrected` by Holm over the table.

    A verdict whose corrected p-value is not below 0.05 is NOT_SEEN.
    """
    table = pd.concat([data_ratios(frame), small_data(frame)], ignore_index=True)
    table["corrected"] = np.nan
    judged = table.says.ne(NO_VERDICT)
    tested = table[judged]
    p = p_values(tested[["value", "low", "high"]], tested.seeds)
    table.loc[judged, "corrected"] = holm(p)
    table.loc[judged & table.corrected.ge(0.05), "says"] = NOT_SEEN
    return table


def page_table(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of `verdicts` that have enough seeds, with the headings of a page."""
    words = {"sidm": "SIDM", FINETUNING: "fine-tuning"}
    rows = [
        {
            "Verdict": row.verdict,
            "System": system_label(row.system),
            "Recipe, stopped by": f"{row.recipe}, {row.rule}",
            "Of": f"{words[row.method]}, {row.minutes:g} min",
            "Quantity": "loss ratio" if row.verdict == "S" else "data ratio",
            "Ours (95 % interval)": DataRatio(
                row.value, row.low, row.high, row.bound
            ).text(3 if row.verdict == "S" else 2),
            "Seeds": row.seeds,
            "p (Holm)": "-" if np.isnan(row.corrected) else f"{row.corrected:.2g}",
            "Says": row.says,
        }
        for row in table[table.seeds >= FEWEST_SEEDS].itertuples()
    ]
    return pd.DataFrame(rows)
