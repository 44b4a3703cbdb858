"""The paper's statements, a row for each reading that was measured.

A statement of sections 3 to 5 may be read in more than one way; each reading has a
comparison, and the verdict follows the rule of the page on claims.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import pandas as pd

from companion.engine.store import Results
from companion.figures.style import system_label
from companion.methods import METHODS
from companion.registry import grid
from companion.statistics import claims
from companion.statistics.intervals import FEWEST_SEEDS
from companion.statistics.pairs import interval_texts, paired_comparison
from companion.statistics.tables import wide
from companion.studies import ablations
from companion.studies.decisive import ablated, verdicts
from companion.studies.decisive.length_curves import RECIPE_LABELS
from companion.studies.latent_space import measure
from companion.studies.reproduction import with_repeats
from companion.study import Study
from sidm.systems import PAPER_SYSTEMS

LITTLE = 5.0  # min of novice data
#: Presets whose results are read: the book's.
BOOK, SMALL = "study", "laptop"
SAVED = '"up to 20 times the amount of data" (system 2: "about 5")'
IMPROVEMENT = '"significant improvement" with little data'
AS_RELEASED, AT_ITS_BEST, EARLY = RECIPE_LABELS.values()
TRAINED = {"R": AS_RELEASED, "T": AT_ITS_BEST}  # by recipe
LESS_EXPERT = f"p_e of {ablations.MOST_DATA_P_EXPERT:g}"
NO_ADVERSARY = METHODS["no_regularisation"].label
OTHER_P_EXPERT = "a high or a low p_e is worse than the paper's"
LONG_PHASE = "too long a phase leads to high losses for the other"
#: Setting of recipe R that step E1 changes, and its value -> a statement on it, which
#: expects a higher loss than R's, and the statement's reading.
BALANCE = {
    ("p_expert", 0.9): (OTHER_P_EXPERT, "loss at a p_e of 0.9 / at the paper's"),
    ("p_expert", 0.25): (OTHER_P_EXPERT, "loss at a p_e of 0.25 / at the paper's"),
    ("matching_iterations", 100.0): (
        LONG_PHASE,
        "prediction loss with 100 matching iterations a phase / with 20",
    ),
}

#: Columns of a table of readings: a statement of the paper, how it is read, what was
#: measured, with its interval, and whether the verdict is corrected by Holm over the
#: verdicts of the decisive experiment, or over a system's settings in its step E1.
COLUMNS = ["statement", "reading", "system", "ours", "seeds", "verdict", "corrected"]


def _readings(
    statement: str,
    reading: str,
    rows: pd.DataFrame,
    corrected: bool | pd.Series = False,
) -> pd.DataFrame:
    """A table with COLUMNS of rows with `system`, `ours`, `seeds` and `verdict`."""
    said = {"statement": statement, "reading": reading, "corrected": corrected}
    named = rows.assign(**said, system=rows.system.map(system_label))
    return named.reindex(columns=COLUMNS)


def _with_texts(rows: pd.DataFrame, quantity: str, digits: int) -> pd.DataFrame:
    """Rows with `value`, `low` and `high` of a ratio, which get the text `ours`."""
    texts = interval_texts(rows[["value", "low", "high"]], digits)
    return rows.assign(ours=[f"{quantity} {text} ×" for text in texts])


def _paired(
    frame: pd.DataFrame,
    reference: pd.DataFrame,
    quantity: str = "loss",
    above: bool = False,
) -> pd.DataFrame:
    """The ratio of losses, paired by seed, beside 1: rows for `_readings`."""
    rows = claims.claim_rows(paired_comparison(frame, reference), "", "", above)
    return rows.assign(ours=[f"{quantity} {text} ×" for text in rows.ours])


def savings(figure3: pd.DataFrame, decisive: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """How much data an SIDM saves with 5 minutes, and its loss with little data."""
    judged = verdicts.verdicts(decisive).query("method == 'sidm'")
    judged = judged.dropna(subset="value").rename(columns={"verdict": "name"})
    judged = judged.rename(columns={"says": "verdict"})
    for name, reading in (("R1", AS_RELEASED), ("T2", AT_ITS_BEST)):
        rows = _with_texts(judged[judged.name == name], "data", 2)
        yield _readings(SAVED, reading, rows, True)
    for system in PAPER_SYSTEMS:
        claimed = claims.data_saving_claim(figure3, system)
        yield _readings(SAVED, EARLY, _with_texts(claimed, "data", 2))
    small = _with_texts(judged[judged.name == "S"], "loss", 3)
    small = small.sort_values("minutes", ascending=False, kind="stable")
    for (minutes, recipe), rows in small.groupby(["minutes", "recipe"], sort=False):
        reading = f"{TRAINED[recipe]}, {minutes:g} min"
        yield _readings(IMPROVEMENT, reading, rows, True)
    sidm, alone = (figure3[figure3.method == n] for n in ("sidm", "novice_only"))
    for minutes in (1.0, LITTLE):
        rows = _paired(sidm[sidm.novice_minutes == minutes], alone)
        yield _readings(IMPROVEMENT, f"{EARLY}, {minutes:g} min", rows)


def hours(figure3: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """Whether the curves meet with hours of data (section 5)."""
    for system in PAPER_SYSTEMS:
        rows = claims.convergence_claim(figure3, system)
        yield _readings('"comparable" with 2 h and 5 h', EARLY, rows)


def paths(figure4: pd.DataFrame, decisive: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """Predicted paths over 25 steps (section 5)."""
    parts: list[tuple[str, pd.DataFrame, tuple[float, ...]]] = [
        (TRAINED[recipe], rows, (LITTLE,))
        for recipe, rows in decisive.groupby("recipe")
    ]
    parts.append((EARLY, figure4, (LITTLE, 120.0)))
    said = "smaller deviation over 25 steps (Figure 4)"
    for reading, frame, sizes in parts:
        for size in sizes:
            rows = claims.figure4_claims(frame, (size,))
            yield _readings(said, f"{reading}, {size:g} min", rows)


def pretraining(
    baselines: pd.DataFrame, bodies: pd.DataFrame
) -> Iterator[pd.DataFrame]:
    """Whether an SIDM can be learnt from the expert alone, in three readings.

    The narrowest, which is nearest to the paper's words (section 4), comes first.
    """
    few = baselines[baselines.novice_minutes == LITTLE]
    parts = []
    for minutes in (LITTLE, 1.0):
        means = _mean_over_bodies(bodies[bodies.novice_minutes == minutes])
        reading = f"core alone copied, five other bodies, {minutes:g} min"
        parts.append((means, "core_finetune", reading))
    parts.append((few, "pretrain_finetune", "all parts copied (held struts)"))
    kept = "SIDM kept, encoder and decoder trained further"
    parts.append((few, "finetune_parts", f"{kept} (held struts)"))
    for frame, method, reading in parts:
        copied, sidm = (frame[frame.method == name] for name in (method, "sidm"))
        rows = _paired(copied, sidm, "loss / SIDM's", above=True)
        said = '"cannot be pretrained using just expert data"'
        yield _readings(said, reading, rows)


def _mean_over_bodies(frame: pd.DataFrame) -> pd.DataFrame:
    """The geometric mean loss over the novices of each seed, method and size."""
    logs = frame.assign(validation_loss=np.log(frame.validation_loss))
    keys = ["system", "novice_minutes", "method", "seed"]
    return np.exp(logs.groupby(keys).validation_loss.mean()).reset_index()


def more_data(
    figure3: pd.DataFrame, changed: Mapping[str, pd.DataFrame]
) -> Iterator[pd.DataFrame]:
    """Whether an SIDM should learn less from the expert as the novice's data grow.

    `changed` has, by the name of a change, its results on the largest novice dataset.
    The paper lowers p_e and the phases together, as the data grow (section 5).
    """
    sidm = figure3[figure3.method == "sidm"]
    for name, frame in changed.items():
        rows = _paired(frame, sidm).assign(verdict=claims.NOT_TESTED)
        said = "with more novice data a lower p_e and less matching"
        yield _readings(said, f"{name}, on the largest dataset", rows)


def alikeness(latents: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """Whether matching made the latents alike (section 3)."""
    few = latents[latents.novice_minutes == LITTLE]
    matched, free = (few[few.method == n] for n in ("sidm", "no_regularisation"))
    for name, quantity in (
        ("network_accuracy", "a fresh classifier's accuracy"),
        ("mmd", "squared MMD"),
    ):
        table = paired_comparison(matched, free, value=name, difference=True)
        rows = claims.claim_rows(table, "", "")
        reading = f"{EARLY}: {quantity}, with 5 matching iterations minus with none"
        yield _readings("latents become alike", reading, rows)


def balance(ratios: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """What step E1 says of p_e and of long phases (section 4), of `ablated.table`."""
    ends = ratios[ratios.rule == verdicts.END]
    for (setting, value), (said, reading) in BALANCE.items():
        rows = ablated.changed_to(ends, setting, value)
        rows = rows.assign(value=rows.ratio, verdict=ablated.says_above(rows))
        rows = _with_texts(rows, "loss", 3)
        named = f"{AS_RELEASED}: {reading}"
        yield _readings(said, named, rows, rows.corrected.notna())


def harmed_prediction(ratios: pd.DataFrame) -> pd.DataFrame:
    """What long matching does to the prediction phase, of `ablated.training_ratios`."""
    rows = ablated.changed_to(ratios, "matching_iterations", 100)
    rows = claims.claim_rows(rows, "", "", above=True)
    reading = f"{AS_RELEASED}: training loss with 100 matching iterations / with 20"
    rows = rows.assign(ours=[f"loss {text} ×" for text in rows.ours])
    return _readings(LONG_PHASE, reading, rows)


def high_p_expert(
    p_expert: pd.DataFrame, study: Study, results: Results
) -> pd.DataFrame:
    """Whether a p_e proportional to the data is too high (section 4)."""
    few = p_expert[p_expert.novice_minutes == LITTLE]
    papers = few.system.map(study.preset.p_expert).astype(float)
    most = ablations.proportional(study.preset, LITTLE)
    usual = with_repeats(few[few.p_expert == papers], results.folder)
    return _readings(
        OTHER_P_EXPERT,
        f"{EARLY}: loss at a p_e proportional to the data (0.96) / at the paper's",
        _paired(few[few.p_expert == most], usual, above=True),
    )


def long_phases(phases: pd.DataFrame, results: Results) -> Iterator[pd.DataFrame]:
    """Whether too long a phase harms the other phase's loss (section 4), recipe Q.

    It has 5 matching iterations, and the paper 20, which are step E1's.
    """
    few = phases[(phases.novice_minutes == LITTLE) & (phases.method == "sidm")]
    usual = few.discriminator_iterations == 20
    usual &= few.prediction_iterations == 100
    usual_phases = with_repeats(
        few[usual & (few.matching_iterations == 5)], results.folder
    )
    for long, reading in (
        (
            few[usual & (few.matching_iterations == 100)],
            f"{EARLY}: loss with 100 matching iterations a phase / with 5",
        ),
        (
            few[few.prediction_iterations == 500],
            f"{EARLY}: the same phase's loss, 500 prediction iterations / 100",
        ),
    ):
        rows = _paired(long, usual_phases, above=True)
        yield _readings(LONG_PHASE, reading, rows.assign(verdict=claims.NOT_TESTED))


def readings(results: Results) -> pd.DataFrame:
    """All readings, with COLUMNS, from the stored results."""

    def frame(preset: str, figure: str) -> pd.DataFrame:
        return results.frame(grid(preset, figure))

    small = Study(SMALL)
    figure3 = frame(BOOK, "3")
    decisive = verdicts.results(Study(BOOK), results)
    balanced = ablated.results(Study(BOOK), results)
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
    tables = [
        *savings(figure3, decisive),
        *hours(figure3),
        *paths(frame(BOOK, "4"), decisive),
        *pretraining(frame(SMALL, "baselines"), frame(SMALL, "other-bodies")),
        *more_data(frame(SMALL, "3"), on_most_data),
        *alikeness(latents),
        *balance(ablated.table(balanced)),
        harmed_prediction(ablated.training_ratios(balanced)),
        high_p_expert(frame(SMALL, "p-expert"), small, results),
        *long_phases(frame(SMALL, "iterations"), results),
    ]
    found = pd.concat(tables, ignore_index=True)
    return found.astype({"seeds": int, "corrected": bool})


def page_table(table: pd.DataFrame) -> pd.DataFrame:
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
    few = table.seeds.eq(FEWEST_SEEDS).map({True: " †", False: ""})
    corrected = table.corrected.map({True: " ‡", False: ""})
    marked = {"seeds": table.seeds.astype(str) + few}
    marked["verdict"] = table.verdict + corrected
    return table.assign(**marked)[list(names)].rename(columns=names)


def nearest_table(table: pd.DataFrame) -> pd.DataFrame:
    """Each statement in its first reading, the nearest: a column per pair of robots."""
    first = table.groupby("statement", sort=False).reading.transform("first")
    table = table[table.reading == first]
    marks = table.corrected.map({True: " ‡", False: ""})
    table = table.assign(text=table.verdict + marks + ": " + table.ours)
    shown = wide(table, ["statement", "reading"], "system", "text")
    return shown.rename(columns={"statement": "The paper says", "reading": "Read as"})
