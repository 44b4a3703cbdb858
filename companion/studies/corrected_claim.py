"""A claim of our own: `corrected_averaged` needs half the data of its best rival.

The protocol was written before the trials were run. `corrected_averaged` (the expert's
model corrected by least squares, mirrored and averaged) was chosen on the same
validation data that first showed it ahead. So it is tested once more, by the rule that
stands here, on data that no choice was made with: seeds from FIRST_SEED on, a novice
pool and validation motion that nothing else uses, and pairs of robots that nothing was
tuned on: the paper's with free struts, and two of the family. The rival `RIVAL` is
fine-tuning with the same two aids (mirrored and averaged); the rivals have the settings
of the laptop preset's tuning.

The claim: with m minutes of novice data the method's mean validation loss is below that
of its best rival with 2 m minutes, and the whole paired 95 % interval of the ratio is
below 1. This holds for every m of SIZES and for every pair of PAIRS, and fails as soon
as it fails at one of them. The best rival is the rival with the lowest mean loss at
that pair and size.
"""

from __future__ import annotations

import pandas as pd

from companion.figures.style import METHOD_STYLES, system_label
from companion.methods import RIVAL
from companion.statistics.pairs import page_table, paired_comparison
from companion.study import Study
from companion.trials import Trial
from sidm.systems import FAMILY_PAIRS, FREE_SYSTEMS

METHOD = "corrected_averaged"
RIVALS = ("sidm", "pretrain_finetune", RIVAL)
SIZES = (1.0, 5.0)  # m, min; the rivals have twice as much
PAIRS = (*FREE_SYSTEMS, *FAMILY_PAIRS)
FIRST_SEED, SEEDS = 100, 5
POOL_MINUTES, VALIDATION_MINUTES = 20.0, 20.0


def trials(study: Study, system: str) -> list[Trial]:
    """The method with m minutes and its rivals with 2 m, on motion for this claim."""
    preset = study.preset.with_motion("claim", POOL_MINUTES, VALIDATION_MINUTES)
    claim, doubled = Study(preset), [2 * minutes for minutes in SIZES]
    trials = claim.points(system, [METHOD], SIZES, seeds=SEEDS)
    trials += claim.points(system, RIVALS, doubled, seeds=SEEDS)
    return [trial.replace(seed=FIRST_SEED + trial.seed) for trial in trials]


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """Ratio of the method's loss to that of its best rival with twice the data.

    A seed counts where the method and every rival have it. The table is made by
    `pairs.paired_comparison`, one row per pair of robots and size, with the best
    `rival`, and whether the claim `holds` there: the whole interval lies below 1.
    """
    point = ["system", "novice_minutes"]
    method, rivals = frame[frame.method == METHOD], frame[frame.method.isin(RIVALS)]
    both = pd.concat([method, rivals.assign(novice_minutes=rivals.novice_minutes / 2)])
    methods = both.groupby([*point, "seed"]).method.transform("nunique")
    both = both[methods == 1 + len(RIVALS)]
    method, rivals = both[both.method == METHOD], both[both.method != METHOD]
    means = rivals.groupby([*point, "method"]).validation_loss.mean()
    lowest = means.groupby(level=[0, 1]).idxmin()  # (system, minutes, method)
    best = lowest.map(lambda key: key[2]).rename("rival").reset_index()
    chosen = rivals.merge(best, left_on=[*point, "method"], right_on=[*best.columns])
    compared = paired_comparison(method, chosen).merge(best, on=point)
    return compared.assign(holds=compared.high < 1)


def for_page(table: pd.DataFrame) -> pd.DataFrame:
    """A table made by `table` as a page shows it."""
    columns = {
        "pair": table.system.map(system_label),
        "m (min)": table.novice_minutes,
        "best rival, with 2m": [METHOD_STYLES[name]["label"] for name in table.rival],
        "its loss": table.reference,
        "loss with m": table["mean"],
        "ratio (95 % interval)": page_table(table)["ratio (95 % interval)"],
        "holds": table.holds.map({True: "yes", False: "no"}),
    }
    return pd.DataFrame(columns)
