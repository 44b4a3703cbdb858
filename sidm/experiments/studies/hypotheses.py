"""What might hold the SIDM back: each suspect changed or taken away, and what that does to the loss."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import accumulate
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sidm.experiments.engine.store import Results, Row
from sidm.experiments.methods import (
    BOTH_OF_SIDM,
    CHOICES,
    METHODS,
    ONE_OPTIMISER,
    ONE_SYSTEM,
    PATIENCE,
    PYTORCH_WEIGHTS,
    RELEASED,
)
from sidm.experiments.statistics.claims import FEWEST_SEEDS, NO_VERDICT
from sidm.experiments.statistics.intervals import Interval, ratio_of_means
from sidm.experiments.studies import ablations
from sidm.experiments.study import Study
from sidm.experiments.trials import Trial
from sidm.systems import SYSTEMS

if TYPE_CHECKING:  # scikit-learn need not be there to judge what rows say
    from sidm.experiments.studies.latent_space.diagnosis import Diagnosis

BETTER, WORSE, NO_DIFFERENCE = "better", "worse", "no difference seen"

# What might hold the SIDM back.
ALIKE = "how alike the robots are"
TOGETHER = "learning from both robots at once"
APART = "an encoder and a decoder for each system"
ADVERSARY = "the adversary"
PHASES = "the balance of the phases"
P_EXPERT = "$p_e$, at little and at much novice data"
STOPPING = "the stopping rule"
FIRST_LAYER = "the encoder's first layer behind the map, which grows with its pixels"
OPTIMISER = "what the optimiser does to parts without gradient"
BATCHES = "the composition of the batches"
RELEASED_TWO = "one optimiser and one system a batch together"
OTHERS = "initial weights, the loss's mean, the weight decay"

#: Other ways to learn from two systems, and whom each clears or convicts.
REPLACED = {
    "no_regularisation": ADVERSARY,
    "strong_matching": ADVERSARY,
    "mmd": ADVERSARY,
    "coral": ADVERSARY,
    "gradient_reversal": ADVERSARY,
    "pooled": APART,
    "pooled_flag": APART,
    "pretrain_finetune": TOGETHER,
    "expert_only": ALIKE,
}

#: Whom a choice of ours is suspected with.
SUSPECTED = {PATIENCE: STOPPING, ONE_SYSTEM: BATCHES, ONE_OPTIMISER: OPTIMISER, PYTORCH_WEIGHTS: OTHERS}

#: Parts of the expert's through which the novice's motion is sent, by what a diagnosis calls its loss.
CROSSED = {
    "expert_encoder_loss": "the expert's encoder, on the novice's motion",
    "expert_decoder_loss": "the expert's decoder, on the novice's motion",
    "expert_path_loss": "both of the expert's, on the novice's motion",
}


class Change(NamedTuple):
    """A change that takes a suspect away, and the trials that it needs."""

    suspect: str
    instead: str
    figure: str  # whose trials these are, as `sidm run --figure` calls it
    trials: list[Trial]


class Finding(NamedTuple):
    """What a change did."""

    suspect: str
    system: str
    minutes: float  # of novice data
    instead: str
    seeds: int
    sidm: float  # mean validation loss with SIDM as it is
    changed: float  # and with the suspect changed
    ratio: Interval  # changed by SIDM's, paired by seed: below 1 where the suspect held it back
    verdict: str


def judged(suspect: str, system: str, minutes: float, instead: str, pairs: np.ndarray) -> Finding:
    """A line from losses (S, 2), SIDM's before the changed one's."""
    found = ratio_of_means(pairs)
    said = NO_VERDICT if len(pairs) < FEWEST_SEEDS else {-1: BETTER, 0: NO_DIFFERENCE, 1: WORSE}[found.side(1)]
    sidm, changed = pairs.mean(0).tolist()
    return Finding(suspect, system, minutes, instead, len(pairs), sidm, changed, found, said)


def grid(study: Study, system: str) -> Iterator[Change]:
    """Each change of a system's SIDM that a training can make."""
    sizes, own = study.preset.baseline_minutes, METHODS["sidm"].training(study.preset, system)
    for method, suspect in REPLACED.items():
        at = sizes[:1] if method == "expert_only" else sizes  # which has no size of its own
        yield Change(suspect, METHODS[method].label, "baselines", study.points(system, [method], at))
    for words, (changes, methods) in CHOICES.items():
        if "sidm" in methods:
            trials = study.changed(**changes).points(system, ["sidm"], study.preset.ablation_minutes[:1])
            yield Change(SUSPECTED.get(words, OTHERS), words, "choices", trials)
    both = study.changed(**RELEASED[BOTH_OF_SIDM][0])
    trials = both.points(system, ["sidm"], study.preset.novice_minutes(system))
    yield Change(RELEASED_TWO, BOTH_OF_SIDM, "released", trials)
    for p in ablations.P_EXPERT:
        if p is not None and p not in (0.0, own.p_expert):
            yield Change(P_EXPERT, f"p_e of {p:g}", "p-expert", ablations.p_expert(study, system, [p]))
    for phase, values in ablations.ITERATIONS.items():
        for value in values:
            if value not in (0, getattr(own, phase)):
                trials = ablations.iterations(study, system, phase, [value])
                yield Change(PHASES, f"{value} {phase.replace('_', ' ')}", "iterations", trials)
    for pixels in ablations.PIXELS:
        if pixels != study.preset.network.pixels:
            trials = ablations.setting(study, system, "pixels", [pixels])
            sidm = [trial for trial in trials if trial.method == "sidm"]
            yield Change(FIRST_LAYER, f"maps of {pixels} pixels", "pixels", sidm)
    alone = METHODS["no_regularisation"].label
    whom = {f"p_e of {ablations.MOST_DATA_P_EXPERT:g}": P_EXPERT, alone: ADVERSARY, PATIENCE: STOPPING}
    for words, trials in ablations.most_data(study, system).items():
        yield Change(whom[words], words, "most-data", trials)


def suspects(
    study: Study, store: Results, diagnoses: Iterable[Diagnosis] = (), systems: Sequence[str] = tuple(SYSTEMS)
) -> list[Finding]:
    """A line a system, size and change of which results are stored, the lowest ratio of each size first.

    Args:
        study: whose trials.
        store: where their rows are.
        diagnoses: of models, for what each of their parts does; those without an adversary stand in for trials.
        systems: which.
    """
    found, diagnoses = [], list(diagnoses)
    apart = {one.trial.key: one.validation_loss for one in diagnoses}
    for system in systems:
        for change in grid(study, system):
            sizes = sorted({trial.novice_minutes for trial in change.trials})
            base = _by_point(study.points(system, ["sidm"], sizes), store, {})
            other = _by_point(change.trials, store, apart)
            for minutes in sizes:
                common = sorted(point for point in base.keys() & other.keys() if point[0] == minutes)
                if common:
                    pairs = np.array([(base[point], other[point]) for point in common])
                    found.append(judged(change.suspect, system, minutes, change.instead, pairs))
        for name, words in CROSSED.items():
            mine = [one for one in diagnoses if (one.trial.system, one.trial.method) == (system, "sidm")]
            for minutes in sorted({one.trial.novice_minutes for one in mine}):
                here = [one for one in mine if one.trial.novice_minutes == minutes]
                pairs = np.array([(one.validation_loss, getattr(one, name)) for one in here])
                found.append(judged(APART, system, minutes, words, pairs))
    return sorted(found, key=lambda one: (one.system, one.minutes, one.ratio.value))


def not_run(
    study: Study, store: Results, diagnoses: Iterable[Diagnosis] = (), systems: Sequence[str] = tuple(SYSTEMS)
) -> dict[str, dict[str, int]]:
    """How many trials of which figures are missing, by suspect; nothing where all are stored or diagnosed."""
    apart, missing = {one.trial.key for one in diagnoses}, dict[str, dict[str, int]]()
    for system in systems:
        for change in grid(study, system):
            left = sum(trial.key not in apart and store.get(trial) is None for trial in change.trials)
            if left:
                figures = missing.setdefault(change.suspect, {})
                figures[change.figure] = figures.get(change.figure, 0) + left
    return missing


class Learnt(NamedTuple):
    """What a method has learnt, and what of it may be only by heart."""

    system: str
    method: str
    minutes: float  # of novice data
    training: float  # mean loss on the novice's samples about when the lowest test loss was reached
    validation: float  # and on motion that no training saw


def learnt(rows: Iterable[Row]) -> list[Learnt]:
    """A line a system, method and size.

    The training loss is the mean of the learning curve's point nearest to the weights that were kept and of its
    neighbours.
    """
    groups: dict[tuple[str, str, float], list[tuple[float, float]]] = {}
    for row in rows:
        outcome, best = row.outcome, _kept(row)
        training = float(np.mean(outcome.curve_training_loss[max(best - 1, 0) : best + 2]))
        key = row.trial.system, row.trial.method, row.trial.novice_minutes
        groups.setdefault(key, []).append((training, outcome.validation_loss))
    order = list(METHODS)
    keys = sorted(groups, key=lambda key: (key[0], order.index(key[1]), key[2]))
    return [Learnt(*key, *np.mean(groups[key], axis=0).tolist()) for key in keys]


def _kept(row: Row) -> int:
    """Number of the learning curve's point at which the weights that were kept were tested, or nearest to it.

    A training that stopped by its patience had its lowest test loss so many samples before; of another the smoothed
    test losses of the curve's summary tell.
    """
    training, outcome = row.trial.training, row.outcome
    if training.stopping == "test_loss" and outcome.samples < training.max_samples:
        return int(np.abs(np.array(outcome.curve_samples) - (outcome.samples - training.patience)).argmin())
    return int(np.argmin(list(accumulate(outcome.curve_test_loss, functools.partial(_blend, training.smoothing)))))


def _blend(weight: float, past: float, now: float) -> float:
    return weight * past + (1 - weight) * now


def _by_point(
    trials: Iterable[Trial], store: Results, otherwise: Mapping[str, float]
) -> dict[tuple[float, int], float]:
    """Validation losses of trials by size and seed: the stored, else those that are known `otherwise` by the key."""
    rows = {trial: store.get(trial) for trial in trials}
    known = {t: row.outcome.validation_loss if row else otherwise.get(t.key) for t, row in rows.items()}
    return {(trial.novice_minutes, trial.seed): loss for trial, loss in known.items() if loss is not None}
