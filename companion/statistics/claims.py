"""The paper's claims (section 5) beside our figures; verdicts follow by the rule of the book's page on claims."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from companion.methods import COMPARED
from companion.statistics.intervals import Interval, interval
from companion.statistics.pairs import beside, complete
from companion.statistics.savings import savings
from sidm.systems import SYSTEMS

REPRODUCED = "Reproduced"
DIRECTION = "In the same direction"
NOT_SEEN = "Not seen"
CONTRARY = "Contrary"
UNCLEAR = "Unclear in the paper"
BETTER, WORSE, NO_DIFFERENCE = "better", "worse", "no difference seen"
#: not run, fewer than three seeds, or sizes from which no figure follows
NO_VERDICT = "No verdict"

#: Of a table of claims: the quantity, the paper's words, its value here with the
#: interval's ends, NaN where unknown.
COLUMNS = (
    "claim",
    "system",
    "paper",
    "value",
    "low",
    "high",
    "ours",
    "seeds",
    "verdict",
)
AT = 5.0  # min of novice data at which claims 1 and 2 are judged
#: claims 1 and 2
SAVED = {"system1": ("up to 20 x", 20.0), "system2": ("about 5 x", 5.0)}


def verdict(
    found: Interval, none: float, paper: float | None = None, above: bool = True
) -> str:
    """What an interval says about a claim that a value lies above `none`, or below, and at the `paper`'s figure.

    One that holds `none` as well as the paper's figure says nothing of either.
    """
    if not np.all(np.isfinite(found)):
        return NO_VERDICT
    side = found.side(none) * (1 if above else -1)
    if side == 1 and paper is not None and found.low <= paper <= found.high:
        return REPRODUCED
    return {1: DIRECTION, 0: NOT_SEEN, -1: CONTRARY}[side]


def judged(
    table: pd.DataFrame,
    claim: str | Sequence[str],
    paper: str,
    above: bool = False,
    unit: str = "",
) -> pd.DataFrame:
    """Lines of a table of claims from a table of `pairs`.

    Args:
        table: of ratios, which the claims hold against 1, or of differences, against 0;
            with `system` and `seeds`.
        claim: the quantity, of all lines or one by one.
        paper: what the paper says of it.
        above: whether the claims are that the value is the larger; else the smaller.
        unit: of a difference.
    """
    name, none = ("difference", 0.0) if "difference" in table else ("ratio", 1.0)
    found = [
        Interval(*ends) for ends in table[[name, "low", "high"]].itertuples(index=False)
    ]
    lines = table[["system", "seeds", "low", "high"]].assign(
        claim=claim,
        paper=paper,
        value=table[name],
        ours=[f"{one.words(3)} {unit}".rstrip() for one in found],
        verdict=[verdict(one, none, above=above) for one in found],
    )
    return lines[list(COLUMNS)]


def beside_one(table: pd.DataFrame) -> np.ndarray:
    """BETTER, WORSE or NO_DIFFERENCE by the whole interval of each ratio of `pairs`; NO_VERDICT where there is none."""
    return np.select(
        [table.high < 1, table.low > 1, table.low.notna()],
        [BETTER, WORSE, NO_DIFFERENCE],
        NO_VERDICT,
    )


def saved(frame: pd.DataFrame, system: str) -> pd.DataFrame:
    """Claims 1 and 2: how many times the data training without SIDM needs for what it reaches with SIDM.

    It is said at one size, fixed before: the one nearest to AT. The greatest of several
    ratios is picked after the fact, which no interval knows of.

    Args:
        frame: of Figure 3.
        system: whose; the paper has a figure for its own two.
    """
    table = savings(frame[frame.system == system])
    if not len(table):
        return pd.DataFrame(columns=list(COLUMNS))
    paper, figure = SAVED.get(system, ("-", None))
    nearest = (np.log(table.novice_minutes) - np.log(AT)).abs().idxmin()
    line = table.loc[nearest]
    found = Interval(line.ratio, line.low, line.high)
    bound = {"=": "", ">=": "at least ", "<=": "at most "}[line.bound]
    words = (
        f"data without SIDM / with SIDM, same loss, {line.novice_minutes:g} min with it"
    )
    line = (
        words,
        system,
        paper,
        *found,
        f"{bound}{found.words(3)} x",
        int(line.seeds),
        verdict(found, 1.0, figure),
    )
    return pd.DataFrame([line], columns=list(COLUMNS))


def met(frame: pd.DataFrame, system: str) -> pd.DataFrame:
    """Claim 3: from which size on the losses with and without SIDM keep to one side of each other, or are alike."""
    losses = complete(frame, system)
    if not losses.values.size:
        return pd.DataFrame(columns=list(COLUMNS))
    every = [
        interval(
            lambda pairs: (pairs[:, 1] - pairs[:, 0]).mean(), losses.values[:, :, n]
        )
        for n in range(len(losses.minutes))
    ]
    sides = [one.side(0) for one in every]
    start = losses.minutes[
        max((n for n, side in enumerate(sides) if side != sides[-1]), default=-1) + 1
    ]
    kind = {1: "better", 0: "alike", -1: "worse"}[sides[-1]]
    ours = (
        f"with SIDM {kind} from {start:g} min on"
        if np.isfinite(every[0]).all()
        else "-"
    )
    line = (
        "the curves become comparable",
        system,
        "at about 2 h or 5 h",
        start,
        np.nan,
        np.nan,
        ours,
    )
    return pd.DataFrame([(*line, len(losses.values), UNCLEAR)], columns=list(COLUMNS))


def pretrained(frame: pd.DataFrame, minutes: float) -> pd.DataFrame:
    """Claim 5: the expert's data alone cannot pretrain the SIDM (section 4)."""
    here = frame[frame.novice_minutes == minutes]
    finetuned, sidm = (
        here[here.method == name] for name in ("pretrain_finetune", "sidm")
    )
    words = f"loss of pretraining and fine-tuning less that with SIDM, {minutes:g} min"
    return judged(
        beside(finetuned, sidm, difference=True),
        words,
        "'cannot be pretrained'",
        above=True,
    )


def figure3_claims(frame: pd.DataFrame, minutes: float = 5.0) -> pd.DataFrame:
    """Claims 1 to 3 and 5 beside Figure 3's results; the last looks at one size, in minutes.

    Ratios and differences are of means over seeds, with 95 % intervals over whole
    seeds.
    """
    parts = [claim(frame, system) for claim in (saved, met) for system in SYSTEMS]
    return pd.concat(
        [part for part in (*parts, pretrained(frame, minutes)) if len(part)] or parts,
        ignore_index=True,
    )


def figure4_claims(
    frame: pd.DataFrame, sizes: Sequence[float] = (5.0, 120.0)
) -> pd.DataFrame:
    """Claim 4 beside Figure 4's results: a smaller deviation over 25 steps."""
    here = frame[frame.novice_minutes.isin(sizes)].assign(
        deviation=frame.position_error.str[-1]
    )
    sidm, alone = (here[here.method == name] for name in COMPARED)
    found = beside(sidm, alone, value="deviation", difference=True).sort_values(
        "novice_minutes"
    )
    words = [
        f"deviation after 2.5 s with SIDM minus without, {minutes:g} min"
        for minutes in found.novice_minutes
    ]
    return judged(found, words, "less (Figure 4)", unit="m")


def written(table: pd.DataFrame) -> pd.DataFrame:
    """A table of claims for a page."""
    names = {
        "claim": "Claim",
        "system": "System",
        "paper": "The paper",
        "ours": "Ours [95 % interval]",
        "seeds": "Seeds",
        "verdict": "Verdict",
    }
    return table[list(names)].rename(columns=names)
