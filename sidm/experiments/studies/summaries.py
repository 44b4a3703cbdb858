"""What came out of a chapter's trials, in short: sentences around measured numbers, which follow by rule."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sidm.experiments.engine.store import Row
from sidm.experiments.statistics.claims import NOT_SEEN, Claim
from sidm.experiments.statistics.savings import expert_first
from sidm.experiments.statistics.tables import final_position_error

NOTHING = "Nothing is stored yet.\n"


def figure3_summary(claims: Sequence[Claim], rows: Sequence[Row], systems: Sequence[str]) -> list[str]:
    """What an SIDM saves, where it no longer does, and what the expert first does, a sentence a system.

    Args:
        claims: of `figure3_claims`.
        rows: of Figure 3.
        systems: which.
    """
    said = []
    for system in systems:
        saved, met, *_ = (one for one in claims if one.claim.startswith(f"{system}:"))
        if not saved.interval:
            said.append(f"{system}: {saved.ours}")
            continue
        or_none = ", which leaves room for none at all" if saved.verdict == NOT_SEEN else ""
        said.append(
            f"{system}: with SIDM as good as without it on {saved.ours} the data{or_none} (the paper: {saved.paper}); "
            f"the two curves {_meeting(met.ours)}; expert first, then novice: {expert_first(rows, system)}"
        )
    return said


def _meeting(ours: str) -> str:
    """Where two curves meet, as the end of a sentence about them."""
    if ours.startswith("too few"):
        return f"have {ours}"
    if ours.startswith(("crossed", "worse")):
        return ours
    return f"are {'not ' * ours.startswith('not ')}comparable {ours.removeprefix('not ')}"


def example_summary(rows: Sequence[Row], seed: int) -> str:
    """How the example of Figure 4, with the models of `seed`, compares with all test trajectories, in a sentence."""
    shown = [row.outcome for row in rows if row.trial.seed == seed]
    if not shown:
        return "The trials of this seed are not stored."
    actual = np.array(shown[0].example_actual)
    driven = np.linalg.norm(np.diff(actual, axis=0), axis=1).sum()
    parted = [float(np.linalg.norm(one.example_predicted[-1] - actual[-1])) for one in shown]
    mean = np.mean([final_position_error(row) for row in rows])
    easy = ", so the example is an easy one" if max(parted) < mean / 2 else ""
    return (
        f"In the example the robot drives {driven:.2g} m, and the predicted paths end {min(parted):.2g} to "
        f"{max(parted):.2g} m from where it comes to. Over all test trajectories and trials that distance is "
        f"{mean:.2g} m in the mean{easy}."
    )
