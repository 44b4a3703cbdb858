"""The paper's claims (section 5) beside our results.

Verdicts follow the rule of the book's page on claims.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from companion.methods import COMPARED
from companion.statistics.pairs import paired_comparison
from companion.statistics.savings import ratio_texts, savings
from ownrobot.comparison.statistics import Interval
from sidm.systems import PAPER_SYSTEMS

REPRODUCED = "Reproduced"
DIRECTION = "In the same direction"
NOT_SEEN = "Not seen"
CONTRARY = "Contrary"
UNCLEAR = "Unclear in the paper"
BETTER, WORSE, NO_DIFFERENCE = "better", "worse", "no difference seen"
#: For trials not run, fewer than three seeds, or sizes that give no value.
NO_VERDICT = "No verdict"
#: what was measured is not what the paper says
NOT_TESTED = "Not tested as stated"

#: Columns of a table of claims: the quantity, the paper's words, our value with the
#: ends of its interval, NaN where unknown.
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
CLAIMED_AT = 5.0  # min of novice data for the verdicts on claims 1 and 2
#: System -> the paper's words and number for claims 1 and 2.
PAPER_SAVINGS = {"system1": ("up to 20 ×", 20.0), "system2": ("about 5 ×", 5.0)}


def verdict(
    estimate: Interval, none: float, paper: float | None = None, above: bool = True
) -> str:
    """Verdict of our value with its interval on a claim.

    An interval that holds `none`, the value without effect, supports no claim, even if
    it holds the `paper`'s value, too. A claim is a value above `none`, unless `above`
    is False.
    """
    if not np.all(np.isfinite(estimate)):
        return NO_VERDICT
    side = estimate.side(none) * (1 if above else -1)
    if side == 1 and paper is not None and estimate.low <= paper <= estimate.high:
        return REPRODUCED
    return {1: DIRECTION, 0: NOT_SEEN, -1: CONTRARY}[side]


def claim_rows(
    table: pd.DataFrame,
    claim: str | Sequence[str],
    paper: str,
    above: bool = False,
    unit: str = "",
) -> pd.DataFrame:
    """Rows of a table of claims from a `paired_comparison` or `pooled_comparison`.

    Claims compare ratios with 1 and differences, which have a `unit`, with 0. `claim`
    is one text for all rows or one a row; `above` is whether it claims a larger value.
    """
    name, none = ("difference", 0.0) if "difference" in table else ("ratio", 1.0)
    columns = table[[name, "low", "high"]]
    estimates = [Interval(*ends) for ends in columns.itertuples(index=False)]
    rows = table[["system", "seeds", "low", "high"]].assign(
        claim=claim,
        paper=paper,
        value=table[name],
        ours=[f"{estimate.text(3)} {unit}".rstrip() for estimate in estimates],
        verdict=[verdict(estimate, none, above=above) for estimate in estimates],
    )
    return rows[list(COLUMNS)]


def ratio_verdicts(table: pd.DataFrame) -> np.ndarray:
    """BETTER, WORSE or NO_DIFFERENCE for each ratio: by its whole interval, if any."""
    return np.select(
        [table.high < 1, table.low > 1, table.low.notna()],
        [BETTER, WORSE, NO_DIFFERENCE],
        NO_VERDICT,
    )


def data_saving_claim(frame: pd.DataFrame, system: str) -> pd.DataFrame:
    """Claims 1 and 2: how many times as much data training needs without SIDM.

    The comparison is at the size of Figure 3's results nearest to CLAIMED_AT, chosen
    before. The largest of several ratios would be chosen after the results, and no
    interval accounts for such a choice. There is one row, or none without results.
    """
    table = savings(frame[frame.system == system])
    if not len(table):
        return pd.DataFrame(columns=list(COLUMNS))
    words, number = PAPER_SAVINGS.get(system, ("-", None))
    nearest = (np.log(table.novice_minutes) - np.log(CLAIMED_AT)).abs().idxmin()
    row = table.loc[nearest]
    estimate = Interval(row.ratio, row.low, row.high)
    claim = (
        f"data without SIDM / with SIDM, same loss, {row.novice_minutes:g} min with it"
    )
    ours = f"{ratio_texts(table.loc[[nearest]], 3)[0]} ×"
    says = verdict(estimate, 1.0, number)
    values = (claim, system, words, *estimate, ours, int(row.seeds), says)
    return pd.DataFrame([values], columns=list(COLUMNS))


def convergence_claim(frame: pd.DataFrame, system: str) -> pd.DataFrame:
    """Claim 3: the size from which the losses with and without SIDM are comparable.

    From this size on, the difference of the losses keeps its sign or shows none. There
    is one row, or none without results of Figure 3.
    """
    frame = frame[frame.system == system]
    sidm, alone = (frame[frame.method == name] for name in COMPARED)
    table = paired_comparison(alone, sidm, by=(), difference=True)
    if not len(table):
        return pd.DataFrame(columns=list(COLUMNS))
    known, seeds = table.low.notna(), table.seeds.min()
    if known.any():
        table = table[known]
    table = table.sort_values("novice_minutes")
    side = (table.low > 0).astype(int) - (table.high < 0)
    # the first size after the last one with another sign
    start = table.novice_minutes[side[::-1].eq(side.iloc[-1]).cummin()].min()
    kind = {1: "better", 0: "alike", -1: "worse"}[side.iloc[-1]]
    ours = f"with SIDM {kind} from {start:g} min on"
    row = {
        "claim": "the curves become comparable",
        "system": system,
        "paper": "at about 2 h or 5 h",
        "value": start,
        "ours": ours if known.any() else "-",
        "seeds": seeds,
        "verdict": UNCLEAR,
    }
    return pd.DataFrame([row], columns=list(COLUMNS))


def pretraining_claim(frame: pd.DataFrame, minutes: float) -> pd.DataFrame:
    """Claim 5: the expert's data alone cannot pretrain the SIDM (section 4)."""
    frame = frame[frame.novice_minutes == minutes]
    finetuned, sidm = (
        frame[frame.method == name] for name in ("pretrain_finetune", "sidm")
    )
    table = paired_comparison(finetuned, sidm, difference=True)
    claim = f"loss of pretraining and fine-tuning less that with SIDM, {minutes:g} min"
    return claim_rows(table, claim, "'cannot be pretrained'", above=True)


def figure3_claims(frame: pd.DataFrame, minutes: float = 5.0) -> pd.DataFrame:
    """Claims 1, 2, 3 and 5 beside the results of Figure 3, for the paper's systems.

    Ratios and differences are of means over seeds, with 95 % intervals over whole
    seeds; claim 5 is checked with so many `minutes` of novice data.
    """
    frame = frame[frame.system.isin(PAPER_SYSTEMS)]
    claims = (data_saving_claim, convergence_claim)
    tables = [claim(frame, system) for claim in claims for system in PAPER_SYSTEMS]
    filled = [
        table for table in (*tables, pretraining_claim(frame, minutes)) if len(table)
    ]
    return pd.concat(filled or tables, ignore_index=True)


def figure4_claims(
    frame: pd.DataFrame, sizes: Sequence[float] = (5.0, 120.0)
) -> pd.DataFrame:
    """Claim 4 beside the results of Figure 4: a smaller deviation after 25 steps."""
    frame = frame[frame.novice_minutes.isin(sizes)].assign(
        deviation=frame.position_error.str[-1]
    )
    sidm, alone = (frame[frame.method == name] for name in COMPARED)
    table = paired_comparison(sidm, alone, value="deviation", difference=True)
    table = table.sort_values("novice_minutes")
    claims = [
        f"deviation after 2.5 s with SIDM minus without, {minutes:g} min"
        for minutes in table.novice_minutes
    ]
    return claim_rows(table, claims, "less (Figure 4)", unit="m")


def figure4_text(frame: pd.DataFrame, minutes: float) -> str:
    """The deviation after 2.5 s with SIDM minus that without, in m, as a text.

    `frame` has results of Figure 4 of one system; `minutes` are of novice data.
    """
    for row in figure4_claims(frame, (minutes,)).itertuples():
        return Interval(row.value, row.low, row.high).text(2)
    return "not run"


def page_table(table: pd.DataFrame) -> pd.DataFrame:
    """A table of claims with the columns and headings of a page."""
    names = {
        "claim": "Claim",
        "system": "System",
        "paper": "The paper",
        "ours": "Ours (95 % interval)",
        "seeds": "Seeds",
        "verdict": "Verdict",
    }
    return table[list(names)].rename(columns=names)
