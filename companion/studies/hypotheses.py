"""What might hold the SIDM back: each hypothesis tested by changes of SIDM, beside SIDM as it is."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from companion.engine.store import Results
from companion.methods import (
    BOTH_OF_SIDM,
    CHOICES,
    METHODS,
    ONE_OPTIMISER,
    ONE_SYSTEM,
    PATIENCE,
    PYTORCH_WEIGHTS,
    RELEASED,
)
from companion.statistics.claims import BETTER, NO_VERDICT, WORSE, beside_one
from companion.statistics.pairs import beside
from companion.studies import ablations
from companion.study import Study
from companion.trials import Trial

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

#: Other ways to learn from two systems, and the hypothesis that each tests.
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

#: The hypothesis that a choice of ours tests.
CONCERNS = {
    PATIENCE: STOPPING,
    ONE_SYSTEM: BATCHES,
    ONE_OPTIMISER: OPTIMISER,
    PYTORCH_WEIGHTS: OTHERS,
}

#: Parts of the expert's through which the novice's motion is sent, by what a diagnosis
#: calls its loss.
CROSSED = {
    "expert_encoder_loss": "the expert's encoder",
    "expert_decoder_loss": "the expert's decoder",
    "expert_path_loss": "both of the expert's",
}

AS_IT_IS = "as it is"
POINT = ["system", "novice_minutes"]


class Change(NamedTuple):
    """A change of SIDM that tests a hypothesis, and the trials that it needs."""

    hypothesis: str
    change: str
    figure: str  # whose trials these are, as `companion run --figure` calls it
    trials: list[Trial]


def changes(study: Study, system: str) -> Iterator[Change]:
    """Each change of a system's SIDM that a training can make."""
    sizes, own = (
        study.preset.baseline_minutes,
        study.preset.training_of(METHODS["sidm"], system),
    )
    for method, hypothesis in REPLACED.items():
        # which has no size of its own
        at = sizes[:1] if method == "expert_only" else sizes
        yield Change(
            hypothesis,
            METHODS[method].label,
            "baselines",
            study.points(system, [method], at),
        )
    for words, (changes, methods) in CHOICES.items():
        if "sidm" in methods:
            trials = study.changed(**changes).points(
                system, ["sidm"], study.preset.ablation_minutes[:1]
            )
            yield Change(CONCERNS.get(words, OTHERS), words, "choices", trials)
    both = study.changed(**RELEASED[BOTH_OF_SIDM][0])
    trials = both.points(system, ["sidm"], study.preset.novice_minutes(system))
    yield Change(RELEASED_TWO, BOTH_OF_SIDM, "released", trials)
    for p in ablations.P_EXPERT:
        if p is not None and p not in (0.0, own.p_expert):
            yield Change(
                P_EXPERT,
                f"p_e of {p:g}",
                "p-expert",
                ablations.p_expert(study, system, [p]),
            )
    for phase, values in ablations.ITERATIONS.items():
        for value in values:
            if value not in (0, getattr(own, phase)):
                trials = ablations.iterations(study, system, phase, [value])
                yield Change(
                    PHASES, f"{value} {phase.replace('_', ' ')}", "iterations", trials
                )
    for pixels in ablations.PIXELS:
        if pixels != study.preset.network.pixels:
            trials = ablations.setting(study, system, "pixels", [pixels])
            sidm = [trial for trial in trials if trial.method == "sidm"]
            yield Change(FIRST_LAYER, f"maps of {pixels} pixels", "pixels", sidm)
    alone = METHODS["no_regularisation"].label
    whom = {
        f"p_e of {ablations.MOST_DATA_P_EXPERT:g}": P_EXPERT,
        alone: ADVERSARY,
        PATIENCE: STOPPING,
    }
    for words, trials in ablations.most_data(study, system).items():
        yield Change(whom[words], words, "most-data", trials)


def frame(study: Study, store: Results, systems: Iterable[str]) -> pd.DataFrame:
    """Stored results by `hypothesis` and `change`, those of SIDM as it is among them."""
    parts = []
    for system in systems:
        own = study.points(
            system,
            ["sidm"],
            [*study.preset.novice_minutes(system), *study.preset.baseline_minutes],
        )
        parts.append(
            store.frame({trial.key: trial for trial in own}.values()).assign(
                change=AS_IT_IS, hypothesis=""
            )
        )
        for one in changes(study, system):
            parts.append(
                store.frame(one.trials).assign(
                    change=one.change, hypothesis=one.hypothesis
                )
            )
    return pd.concat(parts)


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """SIDM changed beside SIDM as it is: `pairs.beside` with a `verdict`, the lowest ratio of each size first."""
    own = frame.change == AS_IT_IS
    found = beside(frame[~own], frame[own], POINT, ["hypothesis", "change"])
    found["verdict"] = beside_one(found)
    return found.sort_values([*POINT, "ratio"], ignore_index=True)


def crossings(diagnoses: pd.DataFrame) -> pd.DataFrame:
    """The loss on the novice's motion through parts of the expert's, beside that through its own: `pairs.beside`."""
    sent = [
        diagnoses.assign(validation_loss=diagnoses[name], change=words)
        for name, words in CROSSED.items()
    ]
    return beside(pd.concat(sent), diagnoses, POINT, ["change"])


def ranking(table: pd.DataFrame) -> pd.DataFrame:
    """Changes by the least ratio that they reach, of comparisons with an interval: how many are better or worse.

    Better and worse are said by the whole interval.
    """
    judged = table[table.verdict != NO_VERDICT]
    judged = judged.assign(
        better=judged.verdict == BETTER, worse=judged.verdict == WORSE
    )
    found = judged.groupby(["hypothesis", "change"]).agg(
        comparisons=("ratio", "size"),
        better=("better", "sum"),
        worse=("worse", "sum"),
        least=("ratio", "min"),
        greatest=("ratio", "max"),
    )
    return found.sort_values("least").reset_index()


def memorised(frame: pd.DataFrame) -> pd.DataFrame:
    """Mean `training` loss about when the lowest test loss was reached, and `validation` loss, by method and size.

    The training loss is the mean of the learning curve's point nearest to the weights
    that were kept and of its neighbours.
    """
    trainings = []
    for row in frame.itertuples():
        best = _kept(row)
        trainings.append(
            float(np.mean(row.curve_training_loss[max(best - 1, 0) : best + 2]))
        )
    order = frame.method.map(list(METHODS).index)
    found = frame.assign(training=trainings, order=order).groupby(
        ["system", "order", "method", "novice_minutes"]
    )
    table = found.agg(
        training=("training", "mean"), validation=("validation_loss", "mean")
    ).reset_index()
    return table.drop(columns="order").assign(ratio=table.validation / table.training)


def _kept(row: Any) -> int:
    """Number of the learning curve's point at which the weights that were kept were tested, or nearest to it.

    A training that stopped by its patience had its lowest test loss so many samples
    before; of another the smoothed test losses of the curve's summary tell.
    """
    if row.stopping == "test_loss" and row.samples < row.max_samples:
        return int(
            np.abs(np.array(row.curve_samples) - (row.samples - row.patience)).argmin()
        )
    return int(
        np.argmin(
            list(
                accumulate(
                    row.curve_test_loss, functools.partial(_blend, row.smoothing)
                )
            )
        )
    )


def _blend(weight: float, past: float, now: float) -> float:
    return weight * past + (1 - weight) * now
