"""The paper's statements, a row for each reading that was measured.

A statement of sections 3 to 5 may be read in more than one way; each reading has a
comparison, and the verdict follows the rule of the page on claims.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from companion.engine.store import Results
from companion.figures.style import system_label
from companion.grids import grid
from companion.methods import METHODS
from companion.statistics import claims
from companion.statistics.intervals import FEWEST_SEEDS
from companion.statistics.pairs import paired_comparison
from companion.statistics.tables import wide
from companion.studies import ablations
from companion.studies.decisive import verdicts
from companion.studies.decisive.along import RECIPE_LABELS
from companion.studies.latent_space import measure
from companion.studies.reproduction import with_repeats
from companion.study import Study
from ownrobot.comparison.statistics import Interval
from sidm.systems import PAPER_SYSTEMS

LITTLE = 5.0  # min of novice data
#: Presets whose results are read: the book's.
BOOK, SMALL = "study", "laptop"
SAVED = '"up to 20 times the amount of data" (system 2: "about 5")'
PRETRAINED = '"cannot be pretrained using just expert data"'
AS_RELEASED, AT_ITS_BEST, EARLY = RECIPE_LABELS.values()
TRAINED = {"R": AS_RELEASED, "T": AT_ITS_BEST}  # by recipe
IMPROVEMENT = '"significant improvement" with little data'

LESS = "with more novice data a lower p_e and less matching"
KEPT = "SIDM kept, encoder and decoder trained further"
LESS_EXPERT = f"p_e of {ablations.MOST_DATA_P_EXPERT:g}"
NO_ADVERSARY = METHODS["no_regularisation"].label


class Reading(NamedTuple):
    """A row: a statement of the paper, how it is read, and what was measured."""

    statement: str
    section: str  # of the paper
    reading: str
    system: str
    ours: str  # the quantity with its interval
    seeds: int
    verdict: str
    corrected: bool = False  # by Holm over the verdicts of the decisive experiment


def _reading(row: Any, statement: str, section: str, reading: str) -> Reading:
    label, seeds = system_label(row.system), int(row.seeds)
    return Reading(statement, section, reading, label, row.ours, seeds, row.verdict)


def _ratio_rows(
    table: pd.DataFrame,
    statement: str,
    section: str,
    reading: str,
    above: bool = False,
    quantity: str = "loss",
) -> list[Reading]:
    """Readings of a table of `paired_comparison`, whose claim is a ratio beside 1."""
    rows = claims.claim_rows(table, "", "", above)
    unit = "" if "difference" in table else " ×"
    rows["ours"] = [f"{quantity} {text}{unit}".strip() for text in rows.ours]
    return [_reading(row, statement, section, reading) for row in rows.itertuples()]


def _judged_row(
    row: Any,
    statement: str,
    reading: str,
    quantity: str,
    says: str,
    corrected: bool = False,
) -> Reading:
    """Reading of a ratio that has a verdict: `value`, `low`, `high` and `seeds`."""
    digits = 2 if quantity == "data" else 3
    ours = f"{quantity} {Interval(row.value, row.low, row.high).text(digits)} ×"
    label = system_label(row.system)
    return Reading(statement, "5", reading, label, ours, row.seeds, says, corrected)


def savings(figure3: pd.DataFrame, decisive: pd.DataFrame) -> list[Reading]:
    """How much data an SIDM saves with 5 minutes, and its loss with little data."""
    rows = []
    judged = verdicts.verdicts(decisive).query("method == 'sidm'")
    judged = judged.dropna(subset="value")
    for verdict, reading in (("R1", AS_RELEASED), ("T2", AT_ITS_BEST)):
        for row in judged[judged.verdict == verdict].itertuples():
            rows.append(_judged_row(row, SAVED, reading, "data", row.says, True))
    for system in PAPER_SYSTEMS:
        for row in claims.data_saving_claim(figure3, system).itertuples():
            rows.append(_judged_row(row, SAVED, EARLY, "data", row.verdict))
    small = judged[judged.verdict == "S"].sort_values(
        "minutes", ascending=False, kind="stable"
    )
    for row in small.itertuples():
        reading = f"{TRAINED[row.recipe]}, {row.minutes:g} min"
        rows.append(_judged_row(row, IMPROVEMENT, reading, "loss", row.says, True))
    sidm, alone = (figure3[figure3.method == n] for n in ("sidm", "novice_only"))
    for minutes in (1.0, LITTLE):
        table = paired_comparison(sidm[sidm.novice_minutes == minutes], alone)
        reading = f"{EARLY}, {minutes:g} min"
        rows += _ratio_rows(table, IMPROVEMENT, "5", reading)
    return rows


def hours(figure3: pd.DataFrame) -> list[Reading]:
    """Whether the curves meet with hours of data."""
    return [
        _reading(row, '"comparable" with 2 h and 5 h', "5", EARLY)
        for system in PAPER_SYSTEMS
        for row in claims.convergence_claim(figure3, system).itertuples()
    ]


def paths(figure4: pd.DataFrame, decisive: pd.DataFrame) -> list[Reading]:
    """Predicted paths over 25 steps."""
    parts: list[tuple[str, pd.DataFrame, tuple[float, ...]]] = [
        (TRAINED[recipe], rows, (LITTLE,))
        for recipe, rows in decisive.groupby("recipe")
    ]
    parts.append((EARLY, figure4, (LITTLE, 120.0)))
    said, rows = "smaller deviation over 25 steps (Figure 4)", []
    for reading, frame, sizes in parts:
        for row in claims.figure4_claims(frame, sizes).itertuples():
            size = row.claim.rpartition(", ")[2]
            rows.append(_reading(row, said, "5", f"{reading}, {size}"))
    return rows


def pretraining(baselines: pd.DataFrame, bodies: pd.DataFrame) -> list[Reading]:
    """Whether an SIDM can be learnt from the expert alone, in three readings.

    The narrowest, which is nearest to the paper's words, comes first.
    """
    few = baselines[baselines.novice_minutes == LITTLE]
    parts = []
    for minutes in (LITTLE, 1.0):
        means = _mean_over_bodies(bodies[bodies.novice_minutes == minutes])
        reading = f"SIDM alone copied, five other bodies, {minutes:g} min"
        parts.append((means, "core_finetune", reading))
    parts.append((few, "pretrain_finetune", "all parts copied (held struts)"))
    parts.append((few, "finetune_parts", f"{KEPT} (held struts)"))
    rows = []
    for frame, method, reading in parts:
        copied, sidm = (frame[frame.method == name] for name in (method, "sidm"))
        table = paired_comparison(copied, sidm)
        rows += _ratio_rows(table, PRETRAINED, "4", reading, True, "loss / SIDM's")
    return rows


def _mean_over_bodies(frame: pd.DataFrame) -> pd.DataFrame:
    """The geometric mean loss over the novices of each seed, method and size."""
    logs = frame.assign(validation_loss=np.log(frame.validation_loss))
    keys = ["system", "novice_minutes", "method", "seed"]
    return np.exp(logs.groupby(keys).validation_loss.mean()).reset_index()


def more_data(figure3: pd.DataFrame, changed: dict[str, pd.DataFrame]) -> list[Reading]:
    """Whether an SIDM should learn less from the expert as the novice's data grow.

    `changed` has, by the name of a change, its results on the largest novice dataset.
    """
    rows, sidm = [], figure3[figure3.method == "sidm"]
    for name, frame in changed.items():
        rows += _ratio_rows(
            paired_comparison(frame, sidm),
            LESS,
            "5",
            f"{name}, on the largest dataset",
        )
    # the paper lowers p_e and the phases together, as the data grow
    return [row._replace(verdict=claims.NOT_TESTED) for row in rows]


def alikeness(latents: pd.DataFrame) -> list[Reading]:
    """Whether matching made the latents alike."""
    rows = []
    few = latents[latents.novice_minutes == LITTLE]
    matched, free = (few[few.method == n] for n in ("sidm", "no_regularisation"))
    for name, quantity in (
        ("network_accuracy", "a fresh classifier's accuracy"),
        ("mmd", "squared MMD"),
    ):
        rows += _ratio_rows(
            paired_comparison(matched, free, value=name, difference=True),
            "latents become alike",
            "3",
            f"{EARLY}: {quantity}, with 5 matching iterations minus with none",
            quantity="",
        )
    return rows


def high_p_expert(p_expert: pd.DataFrame, study: Study) -> list[Reading]:
    """Whether a p_e proportional to the data is too high."""
    few = p_expert[p_expert.novice_minutes == LITTLE]
    papers = few.system.map(study.preset.p_expert).astype(float)
    most = ablations.proportional(study.preset, LITTLE)
    usual = with_repeats(few[few.p_expert == papers], study.results)
    return _ratio_rows(
        paired_comparison(few[few.p_expert == most], usual),
        "a p_e proportional to the data is too high",
        "4",
        "loss at that p_e (0.96, for 2 h of the expert; 14 h: 0.99) / the paper's",
        above=True,
    )


def long_phases(phases: pd.DataFrame, study: Study) -> list[Reading]:
    """Whether too long a phase harms the other phase's loss."""
    few = phases[(phases.novice_minutes == LITTLE) & (phases.method == "sidm")]
    usual = (few.discriminator_iterations == 20) & (few.matching_iterations == 5)
    usual &= few.prediction_iterations == 100
    matching = few.prediction_iterations.eq(100) & few.discriminator_iterations.eq(20)
    rows = []
    for long, reading in (
        (
            few[matching & few.matching_iterations.eq(100)],
            "loss with 100 matching iterations a phase / with 5",
        ),
        (
            few[few.prediction_iterations == 500],
            "the same phase's loss: with 500 prediction iterations / with 100",
        ),
    ):
        rows += _ratio_rows(
            paired_comparison(long, with_repeats(few[usual], study.results)),
            "too long a phase leads to high losses for the other",
            "4",
            reading,
            above=True,
        )
    # the paper's own 20 matching iterations, and the other phase's loss, are step E1's
    return [row._replace(verdict=claims.NOT_TESTED) for row in rows]


def readings(results: Results, data: Path | str = "data") -> list[Reading]:
    """All readings, from the stored results."""

    def frame(preset: str, figure: str) -> pd.DataFrame:
        return results.frame(
            grid(preset, figure, data=str(data), results=str(results.folder))
        )

    small = Study(SMALL, data, results.folder)
    figure3 = frame(BOOK, "3")
    decisive = verdicts.results(Study(BOOK, data, results.folder), results)
    models = [
        trial for system in PAPER_SYSTEMS for trial in measure.jobs(small, system)
    ]
    latents = measure.records(results.folder).frame(models)
    changed: dict[str, list] = {}
    for system in PAPER_SYSTEMS:
        for name, trials in ablations.most_data(small, system).items():
            if name in (LESS_EXPERT, NO_ADVERSARY):
                changed.setdefault(name, []).extend(trials)
    on_most_data = {name: results.frame(trials) for name, trials in changed.items()}
    return [
        *savings(figure3, decisive),
        *hours(figure3),
        *paths(frame(BOOK, "4"), decisive),
        *pretraining(frame(SMALL, "baselines"), frame(SMALL, "other-bodies")),
        *more_data(frame(SMALL, "3"), on_most_data),
        *alikeness(latents),
        *high_p_expert(frame(SMALL, "p-expert"), small),
        *long_phases(frame(SMALL, "iterations"), small),
    ]


def page_table(rows: Iterable[Reading]) -> pd.DataFrame:
    """Readings with the headings of a page.

    Marked are intervals from three seeds, and verdicts that are corrected.
    """
    names = {
        "statement": "The paper says",
        "reading": "Read as",
        "system": "Pair",
        "ours": "Here (95 % interval)",
        "seeds": "Seeds",
        "verdict": "Verdict",
    }
    table = pd.DataFrame(rows, columns=list(Reading._fields))
    few = table.seeds.eq(FEWEST_SEEDS).map({True: " †", False: ""})
    corrected = table.corrected.map({True: " ‡", False: ""})
    marked = {"seeds": table.seeds.astype(str) + few}
    marked["verdict"] = table.verdict + corrected
    return table.assign(**marked)[list(names)].rename(columns=names)


def nearest_table(rows: Iterable[Reading]) -> pd.DataFrame:
    """Each statement in its first reading, the nearest: a column per pair of robots."""
    table = pd.DataFrame(rows, columns=list(Reading._fields))
    first = table.groupby("statement", sort=False).reading.transform("first")
    table = table[table.reading == first]
    marks = table.corrected.map({True: " ‡", False: ""})
    table = table.assign(text=table.verdict + marks + ": " + table.ours)
    shown = wide(table, ["statement", "reading"], "system", "text")
    return shown.rename(columns={"statement": "The paper says", "reading": "Read as"})
