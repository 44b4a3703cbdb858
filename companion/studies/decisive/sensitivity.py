"""How much R's data ratio owes to our cap on the rival's training.

Training alone with 20 minutes of novice data or more reached the cap before the
released rule ended it: a longer training may have a lower loss, and lower the ratio.
Here every seed has the loss of the best seed at such sizes.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from companion.statistics.data_ratio import DataRatio, data_ratio
from companion.statistics.stopping_rules import RULES, apply_rule
from companion.studies.decisive.verdicts import (
    ALONE_SIZES,
    AT,
    RELEASED,
    losses_by,
    wide,
)


def ended_by_rule(frame: pd.DataFrame) -> pd.DataFrame:
    """How many of R's `trainings` the released rule `ended`, not our cap, by size."""
    kept = apply_rule(frame[frame.recipe == "R"], RULES[RELEASED])
    groups = kept.groupby(["system", "method", "novice_minutes"]).ended
    return groups.agg(ended="sum", trainings="size").reset_index()


def ratio_at_best(
    frame: pd.DataFrame, system: str, sizes: tuple[float, ...] = (60.0, 120.0)
) -> DataRatio:
    """R's data ratio at AT minutes, by the released rule or our cap.

    `sizes` are those of training alone at which each seed has the best seed's loss.
    """
    chosen = frame[(frame.recipe == "R") & (frame.system == system)]
    losses = losses_by(chosen, RELEASED)
    alone, sidm = wide(losses, "novice_only", ALONE_SIZES), wide(losses, "sidm", [AT])
    seeds = alone.index.intersection(sidm.index)
    curves = np.array(alone.loc[seeds])
    if len(seeds):
        at = np.isin(ALONE_SIZES, sizes)
        curves[:, at] = np.array(alone)[:, at].min(0)
    return data_ratio(ALONE_SIZES, curves, np.array(sidm.loc[seeds, AT]), AT)
