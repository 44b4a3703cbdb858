"""What might hold the SIDM back: each suspect changed or taken away, and what that does to the loss."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sidm.experiments import ablations
from sidm.experiments.claims import FEWEST_SEEDS, NO_VERDICT
from sidm.experiments.methods import BOTH_OF_SIDM, CHOICES, METHODS, RELEASED
from sidm.experiments.statistics import Interval, ratio_of_means
from sidm.experiments.store import Results, Row
from sidm.experiments.study import Study
from sidm.experiments.trials import Trial
from sidm.systems import SYSTEMS

if TYPE_CHECKING:  # scikit-learn need not be there to judge what rows say
    from sidm.experiments.diagnostics import Diagnosis

BETTER, WORSE, NO_DIFFERENCE = "better so", "worse so", "no difference seen"

#: Other ways to make one model of two systems, and what each takes away.
REPLACED = {
    "no_regularisation": "no adversary",
    "strong_matching": "5 discriminator, 100 matching iterations",
    "mmd": "MMD instead of the adversary",
    "coral": "CORAL instead of the adversary",
    "gradient_reversal": "gradient reversal instead of the adversary",
    "pooled": "one encoder and decoder for both systems",
    "pooled_flag": "one encoder and decoder, told the system",
    "pretrain_finetune": "the expert first, then the novice",
}

#: Parts of the expert's through which the novice's motion is sent, by what a diagnosis calls its loss.
CROSSED = {
    "expert_encoder_loss": "the expert's encoder, on the novice's motion",
    "expert_decoder_loss": "the expert's decoder, on the novice's motion",
    "expert_path_loss": "both of the expert's, on the novice's motion",
}


class Suspect(NamedTuple):
    """A suspect taken away."""

    system: str
    minutes: float  # of novice data
    instead: str
    seeds: int
    sidm: float  # mean validation loss with SIDM as it is
    changed: float  # and with the suspect changed
    ratio: Interval  # changed by SIDM's, paired by seed: below 1 where the suspect held it back
    verdict: str


def judged(system: str, minutes: float, instead: str, pairs: np.ndarray) -> Suspect:
    """A line from losses (S, 2), SIDM's before the changed one's."""
    found = ratio_of_means(pairs)
    said = BETTER if found.high < 1 else WORSE if found.low > 1 else NO_DIFFERENCE
    if len(pairs) < FEWEST_SEEDS:
        said = NO_VERDICT
    sidm, changed = pairs.mean(0).tolist()
    return Suspect(system, minutes, instead, len(pairs), sidm, changed, found, said)


def grid(study: Study, system: str) -> Iterator[tuple[str, list[Trial]]]:
    """Each suspect that a training can change, in words, and its trials."""
    own = METHODS["sidm"].training(study.preset, system)
    small = study.preset.ablation_minutes[:1]
    for method, words in REPLACED.items():
        yield words, study.points(system, [method], study.preset.baseline_minutes)
    for words, (changes, methods) in CHOICES.items():
        if "sidm" in methods:
            yield words, study.changed(**changes).points(system, ["sidm"], small)
    both, _ = RELEASED[BOTH_OF_SIDM]
    yield BOTH_OF_SIDM, study.changed(**both).points(system, ["sidm"], study.preset.baseline_minutes)
    for p in ablations.P_EXPERT:
        if p is not None and p not in (0.0, own.p_expert):
            yield f"p_e of {p:g}", ablations.p_expert(study, system, [p])
    for phase, values in ablations.ITERATIONS.items():
        for value in values:
            if value not in (0, getattr(own, phase)):
                yield f"{value} {phase.replace('_', ' ')}", ablations.iterations(study, system, phase, [value])
    for pixels in ablations.PIXELS:
        if pixels != study.preset.network.pixels:
            trials = ablations.setting(study, system, "pixels", [pixels])
            yield f"maps of {pixels} pixels", [trial for trial in trials if trial.method == "sidm"]


def suspects(
    study: Study, store: Results, diagnoses: Iterable[Diagnosis] = (), systems: Sequence[str] = tuple(SYSTEMS)
) -> list[Suspect]:
    """A line a system, size and suspect of which results are stored, the lowest ratio of each size first.

    Args:
        study: whose trials.
        store: where their rows are.
        diagnoses: of SIDM's models, for what each of their parts does.
        systems: which.
    """
    found, diagnoses = [], [one for one in diagnoses if one.trial.method == "sidm"]
    for system in systems:
        for words, trials in grid(study, system):
            sizes = sorted({trial.novice_minutes for trial in trials})
            base = _by_point(study.points(system, ["sidm"], sizes), store)
            other = _by_point(trials, store)
            for minutes in sizes:
                common = sorted(point for point in base.keys() & other.keys() if point[0] == minutes)
                if common:
                    pairs = np.array([(base[point], other[point]) for point in common])
                    found.append(judged(system, minutes, words, pairs))
        for name, words in CROSSED.items():
            mine = [one for one in diagnoses if one.trial.system == system]
            for minutes in sorted({one.trial.novice_minutes for one in mine}):
                here = [one for one in mine if one.trial.novice_minutes == minutes]
                pairs = np.array([(one.validation_loss, getattr(one, name)) for one in here])
                found.append(judged(system, minutes, words, pairs))
    return sorted(found, key=lambda one: (one.system, one.minutes, one.ratio.value))


class Learnt(NamedTuple):
    """What a method has learnt, and what of it may be only by heart."""

    system: str
    method: str
    minutes: float  # of novice data
    training: float  # mean loss on the novice's samples about when the lowest test loss was reached
    validation: float  # and on motion that no training saw


def learnt(rows: Iterable[Row]) -> list[Learnt]:
    """A line a system, method and size.

    Which weights were kept is told from the smoothed test losses of the learning curve's summary, and the training loss
    is the mean of that point and its neighbours: about that of the weights kept.
    """
    groups: dict[tuple[str, str, float], list[tuple[float, float]]] = {}
    for row in rows:
        outcome = row.outcome
        smooth = list(accumulate(outcome.curve_test_loss, functools.partial(_blend, row.trial.training.smoothing)))
        best = int(np.argmin(smooth))
        training = float(np.mean(outcome.curve_training_loss[max(best - 1, 0) : best + 2]))
        key = row.trial.system, row.trial.method, row.trial.novice_minutes
        groups.setdefault(key, []).append((training, outcome.validation_loss))
    order = list(METHODS)
    keys = sorted(groups, key=lambda key: (key[0], order.index(key[1]), key[2]))
    return [Learnt(*key, *np.mean(groups[key], axis=0).tolist()) for key in keys]


def _blend(weight: float, past: float, now: float) -> float:
    return weight * past + (1 - weight) * now


def _by_point(trials: Iterable[Trial], store: Results) -> dict[tuple[float, int], float]:
    """Validation losses of stored trials by size and seed."""
    return {(r.trial.novice_minutes, r.trial.seed): r.outcome.validation_loss for r in store.rows(trials)}
