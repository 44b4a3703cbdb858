"""What a reader would quote from the book, and what the stored results must say for it.

A claim stands on a page in these words; its predicate reads the stored results.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from companion import Results, Study, grid
from companion.methods import COMPARED, FIGURE3, ONE_OPTIMISER, ONE_SYSTEM
from companion.statistics import claims
from companion.statistics.pairs import paired_comparison
from companion.statistics.stopping_rules import RULES, apply_rule
from companion.studies import (
    ablations,
    baselines,
    choices,
    components,
    corrected_claim,
    hypotheses,
    tuning,
    variants,
)
from companion.studies.decisive import ablated, verdicts
from companion.studies.decisive.length_curves import along_training
from companion.studies.driving import measure as driving
from companion.studies.driving import results as driven
from companion.studies.latent_space import measure as latents
from companion.studies.latent_space.results import crossings
from companion.studies.recorded_targets import measure as recorded
from companion.studies.recorded_targets import results as targets
from companion.studies.reproduction import with_repeats
from companion.studies.several_experts import measure as family
from companion.studies.several_experts import results as several
from companion.studies.uncertainty import measure as uncertainty
from companion.studies.uncertainty import results as likelihoods
from companion.tasks.catalogue import GROUPS
from companion.tasks.run import records as benchmark_records
from companion.tasks.scores import (
    log_ratios,
    pairwise,
    results_frame,
    score_table,
    scores_by_group,
)
from ownrobot.methods.registry import METHODS as LIBRARY
from sidm.systems import FREE_STRUTS, FREE_SYSTEMS, PAPER_SYSTEMS


class Book:
    """The stored results that the book's pages are about, each read once.

    Args:
        folder: of the results.
    """

    def __init__(self, folder: Path) -> None:
        self.store = Results(folder)
        self.study = Study("study")
        self.laptop = Study("laptop")

    def grid(self, preset: str, figure: str) -> pd.DataFrame:
        """Results of a figure."""
        return self.store.frame(grid(preset, figure))

    @functools.cached_property
    def figure3(self) -> pd.DataFrame:
        """Figure 3, stopped early, with the methods drawn beside it."""
        both = [self.grid("study", "3"), self.grid("study", "references")]
        return pd.concat(both)

    @functools.cached_property
    def decisive(self) -> pd.DataFrame:
        """The long trainings, recipes R and T."""
        return verdicts.results(self.study, self.store)

    @functools.cached_property
    def along(self) -> pd.DataFrame:
        """Data ratios with 5 minutes, along the long trainings and by rule."""
        table = along_training(self.decisive)
        return table[table.quantity == "data"]

    def saving(self, recipe: str, system: str, rule: str, minutes: float = 5.0):
        """The data ratio of an SIDM in long trainings."""
        return verdicts.sidm_saving(self.decisive, recipe, system, rule, minutes)

    def loss(self, recipe: str, method: str, minutes: float = 5.0) -> float:
        """Mean loss at the end of long trainings on system 1."""
        rows = self.decisive.query("recipe == @recipe and method == @method")
        rows = rows.query("system == 'system1' and novice_minutes == @minutes")
        return rows.validation_loss.mean()

    @functools.cached_property
    def losses(self) -> pd.DataFrame:
        """Mean loss of Figure 3, by system and size, a column a method."""
        points = self.figure3.groupby(["system", "novice_minutes", "method"])
        return points.validation_loss.mean().unstack()

    @functools.cached_property
    def benchmark(self) -> pd.DataFrame:
        """The benchmark's rows of `ownrobot`'s methods."""
        rows = results_frame(benchmark_records(self.store.folder).all())
        return rows[rows.method.isin(LIBRARY)]

    def scores(self, *groups: str) -> pd.DataFrame:
        """Scores on the tasks of some groups: the loss by that of least squares."""
        names = [task.name for group in groups for task in GROUPS[group]]
        return scores_by_group(self.benchmark, {name: [name] for name in names})

    def beside_usual(self, name: str, system: str, value: float) -> pd.DataFrame:
        """The SIDM's loss at a value of an ablation, by that of Figure 3's setting."""
        usual = ablations.usual(self.laptop.preset, system, name)
        trials = ablations.ablation(self.laptop, system, name, [value, usual])
        frame = self.store.frame(trials)
        reference = with_repeats(frame[frame[name] == usual], self.store.folder)
        return paired_comparison(frame[frame[name] == value], reference)


class Claim(NamedTuple):
    """Words of a page, and whether the stored results bear them out."""

    page: str  # path in the repository
    words: str
    holds: Callable[[Book], bool]


CLAIMS: list[Claim] = []


def claim(page: str, words: str) -> Callable:
    """Say above a predicate which words of a page it bears out."""

    def note(holds: Callable[[Book], bool]) -> Callable[[Book], bool]:
        CLAIMS.append(Claim(page, words, holds))
        return holds

    return note


FIRST_PAGE, FIGURE3_PAGE = "book/intro.md", "notebooks/04-figure3.ipynb"
RIVALS_PAGE, CHOICES_PAGE = "notebooks/07-rivals.ipynb", "notebooks/10-choices.ipynb"
END, RELEASED, PATIENCE = verdicts.END, verdicts.RELEASED, "patience"
ONE, TWO = PAPER_SYSTEMS


@claim(
    FIRST_PAGE,
    "With the authors' released settings, an SIDM saves data on both systems",
)
def released_saves(book: Book) -> bool:
    """Between the paper's number and none."""
    return all(
        1 < book.saving("R", system, rule).low
        and book.saving("R", system, rule).high < most
        for system, most in ((ONE, 20), (TWO, 5))
        for rule in (RELEASED, END)
    )


@claim(FIGURE3_PAGE, "we see no saving with five minutes")
@claim("book/claims.md", "we see no saving with five")
@claim("README.md", "an SIDM saves data with one minute")
@claim(FIRST_PAGE, "an SIDM saves data with one minute; with five we see no saving")
def tuned_saves_with_one(book: Book) -> bool:
    """No saving with five minutes, after Holm's correction; one with one."""
    judged = verdicts.verdicts(book.decisive).query("method == 'sidm'")
    p = judged[judged.verdict == "T2"].corrected.min()
    return (
        book.saving("T", ONE, END).value < 1 < book.saving("T", ONE, END, 1.0).low
        and p > 0.05
    )


@claim(FIGURE3_PAGE, "with 16 million samples, brings the SIDM no gain")
def decay_brings_nothing(book: Book) -> bool:
    """Step E2: with the rival's decay not below the rival, and no difference seen."""
    ratio = verdicts.with_rivals_decay(book.study, book.store)
    return ratio.low < 1 < ratio.value and ratio.high > 1


@claim(FIGURE3_PAGE, "an SIDM pays only after millions of samples")
def early_nothing(book: Book) -> bool:
    """At 1.5 million samples the interval includes 1."""
    rows = book.along.query("system == 'system1' and recipe == 'R' and rule == ''")
    row = rows[rows.samples == 1_500_000].iloc[0]
    return row.low < 1 < row.high and 0.8 < row.value < 1.25


@claim(FIGURE3_PAGE, "Until some 2 million samples, the SIDM is ahead")
def short_saves(book: Book) -> bool:
    """Stopped by this book's patience, an SIDM at its best saves with five minutes."""
    rows = book.along[(book.along.recipe == "T") & (book.along.rule == PATIENCE)]
    return bool((rows.low > 1).all() and len(rows))


@claim(FIGURE3_PAGE, "Fine-tuning the expert's model is far ahead of both")
@claim(
    FIRST_PAGE,
    "fine-tuning the expert's model on five minutes beats training alone on two hours",
)
def finetuning_far_ahead(book: Book) -> bool:
    """Fine-tuned on 5 minutes, less loss than alone on 120."""
    tuned = book.loss("T", "pretrain_finetune")
    return tuned < min(
        book.loss("T", "novice_only", 120.0), 0.6 * book.loss("T", "sidm")
    )


@claim(
    FIGURE3_PAGE,
    "our cap of 4 million samples ended all trainings without SIDM before",
)
def never_ended(book: Book) -> bool:
    """The released rule ended no rival from 20 minutes on, all with less."""
    rows = book.decisive.query("recipe == 'R' and method == 'novice_only'")
    kept = apply_rule(rows, RULES[RELEASED])
    many = kept.novice_minutes >= 20
    return bool(not kept.ended[many].any() and kept.ended[~many].all())


@claim(
    FIGURE3_PAGE,
    "Least squares on the novice alone beat both methods up to five minutes",
)
@claim(
    "README.md",
    "least squares on the novice's own motion are hard to beat with little data",
)
def squares_beat(book: Book) -> bool:
    """Least squares below both of the paper's methods up to five minutes."""
    few = book.losses[book.losses.index.get_level_values("novice_minutes") <= 5]
    others = few[list(COMPARED)]
    return bool(others.gt(few.least_squares, axis=0).all(axis=None) and len(few) == 6)


@claim(
    FIGURE3_PAGE,
    "From an hour of novice data on, at the same $p_e$, the loss is higher with",
)
def worse_from_an_hour_on(book: Book) -> bool:
    """The curves never become comparable: the SIDM's is higher from 60 minutes on."""
    found = {
        claims.convergence_claim(book.figure3, s).ours.iloc[0] for s in PAPER_SYSTEMS
    }
    return found == {"with SIDM worse from 60 min on"}


@claim(FIGURE3_PAGE, "Fine-tuning beats both of the paper's methods at every size")
def finetuning_beats_both(book: Book) -> bool:
    """The lowest loss at every size with held struts."""
    others = book.losses[["sidm", "novice_only", "least_squares"]]
    return bool((book.losses.pretrain_finetune < others.min(axis=1)).all())


@claim(FIGURE3_PAGE, "on both systems fine-tuning gains far less from the expert")
def free_finetuning_small(book: Book) -> bool:
    """With free struts less than a fifth of the saving, with one minute."""
    from companion.statistics.savings import savings

    trials = [t for s in FREE_SYSTEMS for t in book.study.free_struts(s)]
    saved = savings(pd.concat([book.figure3, book.store.frame(trials)]), [FIGURE3[-1]])
    saved = saved[saved.novice_minutes == 1]
    ratio = saved.set_index("system").ratio
    return all(5 * ratio[name + FREE_STRUTS] < ratio[name] for name in PAPER_SYSTEMS)


@claim(
    RIVALS_PAGE,
    "on two real robots no method is clearly better than least squares",
)
@claim(FIRST_PAGE, "no method clearly beat [least squares]")
def recorded_unbeaten(book: Book) -> bool:
    """No method surely beats least squares on the two real robots."""
    tasks = {"recorded": [task.name for task in GROUPS["quick"]]}
    scores = scores_by_group(book.benchmark, tasks).recorded.dropna()
    return len(scores) > 10 and not any(score.high < 1 for score in scores)


@claim(
    RIVALS_PAGE,
    "the corrected network clearly has less loss than the same network fine-tuned",
)
def corrected_beats_tuned(book: Book) -> bool:
    """The expert's network, corrected, below the same network fine-tuned."""
    from companion.tasks.scores import mean_of

    for task in GROUPS["held"] + GROUPS["family"]:
        logs = log_ratios(book.benchmark[book.benchmark.task == task.name])
        if not mean_of(logs.corrected - logs.pretrain_finetune).interval[2] < 1:
            return False
    return True


@claim(
    RIVALS_PAGE,
    "no method that learns from the expert has less loss than a Gaussian process",
)
def no_loss_beats_process(book: Book) -> bool:
    """With free struts no method that learns from an expert is below the process."""
    scores = book.scores("free")
    return not any(
        score.value < column["gp"].value and LIBRARY[name].needs_expert
        for _, column in scores.items()
        for name, score in column.dropna().items()
    )


@claim("book/benchmark.md", "an SIDM that stops early is behind least squares")
def sidm_behind_squares(book: Book) -> bool:
    """Apart after Holm's correction; the corrected network has the lowest score."""
    pairs = pairwise(book.benchmark)
    pair = pairs[(pairs["first"] == "least_squares") & (pairs.second == "sidm")]
    scores = score_table(book.benchmark).set_index("method")
    expert = scores[[LIBRARY[name].needs_expert for name in scores.index]]
    return bool(pair.apart.all() and len(pair)) and (
        scores.score.idxmin() == expert.score.idxmin() == "corrected"
    )


@claim(
    RIVALS_PAGE,
    "Pretraining and fine-tuning has a loss lower than the SIDM's by a fifth to two "
    "fifths",
)
def joint_training(book: Book) -> bool:
    """Fine-tuning and joint training beside the SIDM, on both systems, two sizes."""
    trials = [t for s in PAPER_SYSTEMS for t in baselines.trials(book.laptop, s)]
    table = baselines.table(book.store.frame(trials), book.store.folder, {})
    table = table[table.novice_minutes.isin(book.laptop.preset.baseline_minutes)]
    tuned = table[table.method == "pretrain_finetune"]
    pooled = table[table.method.isin(["pooled", "pooled_flag"])]
    return bool(
        (len(tuned), len(pooled)) == (4, 8)
        and tuned.to_sidm_high.lt(1).all()
        and tuned.to_sidm.between(0.6, 0.8).all()
        and pooled.to_sidm_high.lt(1).all()
        and pooled.to_sidm.between(0.65, 0.84).all()
    )


@claim(
    "notebooks/05-p-expert-and-phases.ipynb",
    "On system 1 we see no gain: 0.9 gives",
)
@claim(
    "notebooks/05-p-expert-and-phases.ipynb",
    "On system 2 there are too few seeds to tell.",
)
def balance(book: Book) -> bool:
    """p_e of 0.9 on system 2 and 100 iterations on system 1, not the other way."""
    sure, other = (
        [
            book.beside_usual("p_expert", pair[0], 0.9),
            book.beside_usual("matching_iterations", pair[1], 100),
        ]
        for pair in ((TWO, ONE), (ONE, TWO))
    )
    unclear, few = other
    return (
        all((t.high < 1).all() and len(t) for t in sure)
        and not (unclear.high < 1).any()
        and few.high.isna().all()  # no interval
        and len(few) > 0
    )


@claim(
    "notebooks/05-p-expert-and-phases.ipynb",
    "On system 1 no change of $p_e$ or of a phase does.",
)
def released_balance(book: Book) -> bool:
    """Of step E1's settings a p_e of 0.75 on system 2 differs, and no other.

    On system 1 no p_e has a lower mean than the paper's. Long matching raises the loss
    on the training data of both.
    """
    frame = ablated.results(book.study, book.store)
    table = ablated.table(frame).query("rule == @verdicts.END")
    learnt = ablated.training_ratios(frame)
    harmed = learnt.query("setting == 'matching_iterations' and value == 100")
    differing = table[table.differs]
    first = table.query("system == 'system1'")
    return bool(
        len(table) == 16
        and (first.low.lt(1) & first.high.gt(1)).all()
        and first[first.setting == "p_expert"].ratio.gt(1).all()
        and differing[["system", "value"]].values.tolist() == [["system2", 0.75]]
        and differing.high.lt(1).all()
        and len(harmed) == 2
        and harmed.low.gt(1).all()
    )


@claim(
    "notebooks/06-figure4.ipynb",
    "more data and fine-tuning bring paths nearer; for an SIDM we see no such effect",
)
def short_paths(book: Book) -> bool:
    """Figure 4 stopped early: not seen at both sizes."""
    frame = book.grid("laptop", "4")
    found = claims.figure4_claims(frame, book.laptop.preset.figure4_minutes)
    return found.verdict.tolist() == [claims.NOT_SEEN, claims.NOT_SEEN]


@claim("notebooks/09-latent-space.ipynb", "13 of 18 intervals confirm it")
def planar_components(book: Book) -> bool:
    """13 of 18 intervals with 1 to 5 minutes, 2 of 12 for roll and pitch rates."""
    trials = [t for s in PAPER_SYSTEMS for t in components.trials(book.study, s)]
    table = components.table(book.store.frame(trials))
    few = table[table.novice_minutes <= 5]
    planar = ["translation y", "quaternion z", "angular velocity z"]
    tilting = ["angular velocity x", "angular velocity y"]
    counts = [
        ((rows.high < 1).sum(), len(rows))
        for names in (planar, tilting)
        for rows in [few[few.component.isin(names)]]
    ]
    most = table[table.novice_minutes == 120]
    return counts == [(13, 18), (2, 12)] and not (most.high < 1).any() and len(most) > 0


@functools.cache
def measured_latents(book: Book) -> pd.DataFrame:
    """What was measured in the latent spaces."""
    jobs = [j for s in PAPER_SYSTEMS for j in latents.jobs(book.laptop, s)]
    return latents.records(book.store.folder).frame(jobs)


@claim("notebooks/09-latent-space.ipynb", "are not system invariant")
def not_invariant(book: Book) -> bool:
    """Fresh classifiers tell latents apart; a swapped part costs 2 to 7 times."""
    measured = measured_latents(book)
    crossed = crossings(measured[measured.method == "sidm"])
    single = crossed[crossed.change != "both of the expert's"]
    told = measured[["linear_accuracy", "network_accuracy"]].min(axis=None)
    return bool(told > 0.99 and single.ratio.between(2, 7.2).all())


@claim(
    RIVALS_PAGE,
    "with all four amounts on both systems, and every 95 % interval",
)
def halved(book: Book) -> bool:
    """Corrected, with half the data, below the SIDM and fine-tuning at all sizes."""
    trials = [t for s in PAPER_SYSTEMS for t in variants.correction(book.laptop, s)]
    table = variants.table(book.store.frame(trials), ["corrected_averaged"])
    return len(table) == 16 and bool((table.high < 1).all())


@claim(
    RIVALS_PAGE,
    "With half the data its loss is clearly lower in only three of eight",
)
def claim_fails(book: Book) -> bool:
    """Our own claim: surely lower in three of eight, higher in none."""
    trials = [corrected_claim.trials(book.study, p) for p in corrected_claim.PAIRS]
    table = corrected_claim.table(book.store.frame(sum(trials, [])))
    return table.holds.sum() == 3 and len(table) == 8 and bool((table.low < 1).all())


@claim(
    "notebooks/12-driving.ipynb",
    "No planner with a learned model does better than the driver that steers straight",
)
def straight_driver(book: Book) -> bool:
    """No planner with a model reaches surely more goals than the straight driver."""
    jobs = [
        job
        for system in PAPER_SYSTEMS
        for job in driving.jobs(book.laptop, system, [1.0, 5.0, 60.0], 50, 10, 20.0)
    ]
    table = driven.table(driving.records(book.store.folder).frame(jobs))
    rivals = driven.rivals(table)
    straight = rivals[rivals.other == driven.OTHERS["straight"]]
    sure = straight[straight.chance < 0.05]
    return len(straight) == 18 and not (sure.more > sure.fewer).any()


@claim("notebooks/13-uncertainty.ipynb", "One step ahead, yes; along a path, no.")
def knows_one_step(book: Book) -> bool:
    """Likelier with 5 minutes or more, on both systems, with SIDM and without."""
    jobs = [
        job
        for system in PAPER_SYSTEMS
        for job in uncertainty.jobs(book.laptop, system, [1.0, 5.0, 60.0], 64)
    ]
    table = likelihoods.table(uncertainty.records(book.store.folder).frame(jobs))
    table = table[table.likelihood.astype(bool)]
    more = table[table.novice_minutes > 1]
    return len(more) == 8 and bool((more.high < 0).all())


@claim(
    "notebooks/14-several-experts.ipynb",
    "With 8 experts the 95 % interval of the ratio lies above 1 at every size",
)
def more_experts_worse(book: Book) -> bool:
    """Eight experts are a worse start than the paper's at every size."""
    jobs = family.jobs(book.laptop, ONE)
    by_size = several.by_size(
        several.table(family.records(book.store.folder).frame(jobs))
    )
    rows = by_size[(by_size.experts == "8 experts") & (by_size.way == "all")]
    return len(rows) == 3 and bool((rows.low > 1).all())


@claim("notebooks/11-recorded-robot.ipynb", "hardly changes the loss")
def recordings_replaced(book: Book) -> bool:
    """One minute of recordings hardly changes the loss of the simulated novice."""
    jobs = [
        job
        for system in PAPER_SYSTEMS
        for job in recorded.jobs(book.laptop, system, "recordings", [1.0, 2.0, 5.0])
    ]
    losses = targets.table(recorded.records(book.store.folder).frame(jobs))
    for system in PAPER_SYSTEMS:
        rows = losses[losses.system == system]
        lines = targets.by_size(rows, targets.best_alone(losses, system))
        least = lines[lines.novice_minutes == 1].loss.min()
        bare = lines[lines.novice_minutes == 0].loss.min()
        if not 0.98 < least / bare < 1.02:
            return False
    return True


@claim(
    CHOICES_PAGE,
    "Of 14 comparisons on five minutes of system 1's data, for an SIDM, training alone "
    "and fine-tuning, three show a difference",
)
def three_of_fourteen(book: Book) -> bool:
    """Of the choices changed one at a time three show a difference."""
    frame = choices.frame(book.laptop, book.store, [ONE])
    table = choices.table(frame, book.store.folder)
    apart = table[(table.low > 1) | (table.high < 1)]
    lower = set(apart[apart.high < 1].choice)
    return (len(table), len(apart)) == (14, 3) and lower == {ONE_SYSTEM, ONE_OPTIMISER}


@claim(CHOICES_PAGE, "Three changes help in all four comparisons")
def three_changes(book: Book) -> bool:
    """Fine-tuning and joint training, with a flag and without, help in all four."""
    frame = hypotheses.frame(book.laptop, book.store, PAPER_SYSTEMS)
    ranking = hypotheses.ranking(hypotheses.table(frame, book.store.folder))
    whole = ranking[(ranking.comparisons == 4) & (ranking.better == 4)]
    return len(whole) == 3


@claim(FIGURE3_PAGE, "an SIDM saves about three times the data with one minute")
def tuned_for_little(book: Book) -> bool:
    """Tuned for little data an SIDM saves about three times with one minute."""
    from companion.methods import FOR_LITTLE
    from companion.statistics.savings import savings

    little = tuning.little_data_results(book.study, book.store, PAPER_SYSTEMS)
    alone = tuning.best_novice_only(book.grid("study", "3"), little)
    saved = savings(pd.concat([little, alone]), ["sidm" + FOR_LITTLE])
    least = saved[saved.novice_minutes == 1]
    return (
        len(least) == 2
        and bool(least.ratio.between(2.6, 3.6).all())
        and bool((saved.low > 1).all())
    )


@claim(
    FIGURE3_PAGE,
    "With tuned settings it is the network trained alone that needs a long",
)
def alone_still_gains(book: Book) -> bool:
    """At its best the rival's weights come late, the SIDM's early."""
    rows = book.decisive.query("recipe == 'T' and novice_minutes == 5")
    kept = apply_rule(rows, RULES[END]).groupby("method").kept_samples
    return kept.median().novice_only > 5e6 and kept.max().sidm < 1e6
