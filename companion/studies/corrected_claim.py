"""A claim about a method of ours, its protocol written before its trials were run: half the data of the best rival.

`corrected_averaged` (the expert's model corrected by least squares, mirrored and
averaged) was chosen on the validation data that it was first judged on. So it is judged
again, by a rule that stands here, on data that nothing was chosen by: seeds from
FIRST_SEED on, a pool and validation motion of their own, and pairs of robots that
nothing was tuned on: the paper's with free struts, and two of the family. Fine-tuning
has its aids, too; the rivals have the settings that the laptop's tuning gave them.

The claim: with m minutes of novice data its mean validation loss is below that of the
best rival with 2 m, the rival of the lowest mean at that pair and size, the whole
paired 95 % interval of the ratio below 1, at every m of SIZES and for every pair of
PAIRS.
"""

from __future__ import annotations

import pandas as pd

from companion.methods import RIVAL
from companion.statistics.intervals import FEWEST_SEEDS
from companion.statistics.pairs import beside
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
    """The method with m minutes and its rivals with 2 m, on motion that serves this alone."""
    own = study.of(study.preset.with_motion("claim", POOL_MINUTES, VALIDATION_MINUTES))
    found = own.points(system, [METHOD], SIZES, seeds=SEEDS)
    found += own.points(system, RIVALS, [2 * minutes for minutes in SIZES], seeds=SEEDS)
    return [trial.replace(seed=FIRST_SEED + trial.seed) for trial in found]


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """The method beside the best rival with twice its data: `pairs.beside` by pair and size, with that `rival`.

    A seed counts where the method and every rival have it.

    `holds` says whether the claim does there: the whole interval of the ratio lies
    below 1.
    """
    point = ["system", "novice_minutes"]
    own, rivals = frame[frame.method == METHOD], frame[frame.method.isin(RIVALS)]
    both = pd.concat([own, rivals.assign(novice_minutes=rivals.novice_minutes / 2)])
    both = both[
        both.groupby([*point, "seed"]).method.transform("nunique") == 1 + len(RIVALS)
    ]
    own, rivals = both[both.method == METHOD], both[both.method != METHOD]
    means = rivals.groupby([*point, "method"]).validation_loss.mean()
    best = (
        means.groupby(level=[0, 1])
        .idxmin()
        .map(lambda key: key[2])
        .rename("rival")
        .reset_index()
    )
    chosen = rivals.merge(best, left_on=[*point, "method"], right_on=[*best.columns])
    found = beside(own, chosen).merge(best, on=point)
    return found.assign(holds=found.high < 1)


def verdict(table: pd.DataFrame) -> bool | None:
    """Whether the claim holds at every pair and size: not if it fails at one, None before all have FEWEST_SEEDS."""
    run = table[table.seeds >= FEWEST_SEEDS]
    whole = len(run) == len(PAIRS) * len(SIZES)
    return (True if whole else None) if run.holds.all() else False
