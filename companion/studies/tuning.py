"""How the methods were tuned: the same number of tries each, with a seed that no figure has, by test loss alone.

The preset `laptop` has the try of the lowest test loss on system 1, at one middle size;
those on system 2 are a check. A preset with motion of its own for it, as `study`, has
other tries, at a small size; LITTLE names the best of them.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pandas as pd

from companion.engine.store import Results
from companion.methods import FOR_LITTLE, METHODS
from companion.presets import MOST_SEEDS, Preset
from companion.study import Study
from companion.trials import Trial
from sidm.systems import SYSTEMS

TUNING_SEED = MOST_SEEDS  # no figure's: theirs are below


def rate_and_batch(batch: int, learning_rate: float) -> dict[str, Any]:
    """A batch and a rate, tests as often in samples as the preset's, the phases of Algorithm 2 with the same batch."""
    return dict(
        batch=batch,
        discriminator_batch=batch,
        matching_batch=batch,
        learning_rate=learning_rate,
        test_interval=200 // batch,
    )


_ALL: dict[str, dict[str, Any]] = {
    "batch 8, rate 0.001 (the base)": rate_and_batch(8, 1e-3),
    "batch 8, rate 0.0005": rate_and_batch(8, 5e-4),
    "batch 4, rate 0.001": rate_and_batch(4, 1e-3),
    "batch 4, rate 0.0005": rate_and_batch(4, 5e-4),
    "patience 450,000": {"patience": 450_000},
}

#: Method -> its tries, in words and as changes of the untuned preset, for all trainings
#: of the method.
TRIES: dict[str, dict[str, dict[str, Any]]] = {
    "novice_only": _ALL
    | {
        "batch 2, rate 0.0003": rate_and_batch(2, 3e-4),
        "weight decay 0.1": {"weight_decay": 0.1},
    },
    "sidm": _ALL
    | {
        "the other system's p_e": {"p_expert_system1": 0.5, "p_expert_system2": 0.75},
        "5 matching iterations": {"matching_iterations": 5},
    },
    "pretrain_finetune": _ALL
    | {
        "rate 0.0003 of the fine-tuning alone": {
            "tuned": (("pretrain_finetune", "learning_rate", 3e-4),)
        },
        "rate 0.0001 of the fine-tuning alone": {
            "tuned": (("pretrain_finetune", "learning_rate", 1e-4),)
        },
    },
}


def _alone(method: str, **values: Any) -> dict[str, Any]:
    """Settings of a method's own training, not of its pretraining."""
    return {"tuned": tuple((method, name, value) for name, value in values.items())}


#: The same of presets that have motion of their own for tuning; the base has a rate of
#: 0.001, batches of 8, the paper's p_e and 20 matching iterations.
LITTLE_TRIES: dict[str, dict[str, dict[str, Any]]] = {
    "novice_only": {
        "the base": {},
        "rate 0.0003": {"learning_rate": 3e-4},
        "batch 4": rate_and_batch(4, 1e-3),
        "batch 4, rate 0.0003": rate_and_batch(4, 3e-4),
        "weight decay 0.1": {"weight_decay": 0.1},
        "weight decay 0.1, rate 0.0003": {"weight_decay": 0.1, "learning_rate": 3e-4},
    },
    "sidm": {
        "the base": {},
        "rate 0.0003": {"learning_rate": 3e-4},
        "p_e 0.9": {"p_expert_system1": 0.9, "p_expert_system2": 0.9},
        "5 matching iterations": {"matching_iterations": 5},
        "100 matching iterations": {"matching_iterations": 100},
        "p_e 0.9, 100 matching iterations": {
            "p_expert_system1": 0.9,
            "p_expert_system2": 0.9,
            "matching_iterations": 100,
        },
    },
    "pretrain_finetune": {
        "the base": {},
        "fine-tuning at 0.0003": _alone("pretrain_finetune", learning_rate=3e-4),
        "fine-tuning at 0.0001": _alone("pretrain_finetune", learning_rate=1e-4),
        "fine-tuning at 0.00003": _alone("pretrain_finetune", learning_rate=3e-5),
        "fine-tuning at 0.0001, weight decay 0.1": _alone(
            "pretrain_finetune", learning_rate=1e-4, weight_decay=0.1
        ),
        "pretraining at 0.0003, fine-tuning at 0.0001": {
            "tuned": (
                ("pretraining", "learning_rate", 3e-4),
                ("pretrain_finetune", "learning_rate", 1e-4),
            ),
        },
    },
}


#: The try with a system's lowest test loss at 5 minutes, of methods that Figure 3 has
#: more than LITTLE_WORTH above it.
LITTLE = {
    "system1": {"sidm": "p_e 0.9, 100 matching iterations"},
    "system2": {"sidm": "p_e 0.9, 100 matching iterations", "novice_only": "batch 4"},
}
LITTLE_WORTH = 0.01  # share of the loss
LITTLE_MINUTES = 5.0  # up to which Figure 3 is run with these settings


def tries_of(preset: Preset) -> dict[str, dict[str, dict[str, Any]]]:
    """The tries of a preset's methods."""
    return (
        LITTLE_TRIES
        if preset.tuning_pool_minutes or preset.motion == "tuning"
        else TRIES
    )


def tried(preset: Preset, method: str, words: str) -> Preset:
    """The preset of a try of a method: untuned but for the try's changes."""
    return _untuned_but(preset, tries_of(preset)[method][words])


def _untuned_but(preset: Preset, changes: dict[str, Any]) -> Preset:
    return preset.replace(**({"tuned": ()} | changes))


def tries(study: Study, system: str) -> list[tuple[str, Trial]]:
    """Every try of every method at each of the tuning's sizes: its words, and its trial."""
    base = study.preset.for_tuning()
    return [
        (
            words,
            study.of(tried(base, method, words)).trial(
                system, method, minutes, TUNING_SEED
            ),
        )
        for minutes in base.tuning_minutes
        for method, its in tries_of(base).items()
        for words in its
    ]


def trials(study: Study, system: str) -> list[Trial]:
    """The trials of all tries."""
    return [trial for _, trial in tries(study, system)]


def little_data(study: Study, system: str) -> list[Trial]:
    """Figure 3 with little data again, with what its methods were tuned to at 5 minutes: those that LITTLE names."""
    sizes, found = (
        [one for one in study.preset.novice_minutes(system) if one <= LITTLE_MINUTES],
        [],
    )
    for method, words in LITTLE[system].items():
        own = study.of(_untuned_but(study.preset, LITTLE_TRIES[method][words]))
        found += own.points(system, [method], sizes, seeds=study.preset.seeds)
    return found


def for_little(study: Study, store: Results, systems: Iterable[str]) -> pd.DataFrame:
    """The stored results of `little_data`, their methods under the names that figures have for them."""
    found = store.frame(
        [trial for system in systems for trial in little_data(study, system)]
    )
    return found.assign(method=found.method + FOR_LITTLE)


def best_alone(frame: pd.DataFrame, little: pd.DataFrame) -> pd.DataFrame:
    """Training without SIDM at its best: of `for_little` where that has it, else of Figure 3."""
    at = ["system", "novice_minutes"]
    own, usual = (
        little[little.method == "novice_only" + FOR_LITTLE],
        frame[frame.method == "novice_only"],
    )
    rest = usual[~usual.set_index(at).index.isin(own.set_index(at).index)]
    return pd.concat([own.assign(method="novice_only"), rest])


def frame(study: Study, store: Results, systems: Iterable[str]) -> pd.DataFrame:
    """Stored tries, with their words as `try` and whether they are what the preset has as `used`."""
    base, parts = study.of(study.preset.for_tuning()), []
    for system in systems:
        for words, trial in tries(study, system):
            own = base.trial(system, trial.method, trial.novice_minutes, TUNING_SEED)
            parts.append(
                store.frame([trial]).assign(
                    **{"try": words, "used": own.key == trial.key}
                )
            )
    return pd.concat(parts)


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """A line a try, its losses and samples; `lowest` marks the first lowest test loss of a system, size and method.

    The test loss is the smoothed one of the weights that were kept, which the choice
    goes by; samples are those of the prediction and of the pretraining.
    """
    groups = frame.groupby(["system", "novice_minutes", "method"]).best_test_loss
    found = frame.assign(
        samples=frame.samples + frame.pretraining_samples,
        lowest=frame.index == groups.transform("idxmin"),
    )
    names = [
        "system",
        "novice_minutes",
        "method",
        "try",
        "best_test_loss",
        "validation_loss",
        "samples",
        "lowest",
    ]
    return found[[*names, "used"]].reset_index(drop=True)


#: What was tuned, as a training names it.
TUNED = (
    "learning_rate",
    "batch",
    "weight_decay",
    "patience",
    "prediction_iterations",
    "discriminator_iterations",
    "matching_iterations",
)


def settings(preset: Preset) -> pd.DataFrame:
    """What each method came to: a line a setting, a column a method of TRIES.

    A pretraining's value stands before the fine-tuning's where they differ, p_e before
    the systems.
    """
    found = {
        method: [
            _p_expert(preset, method),
            *(_tuned(preset, method, one) for one in TUNED),
        ]
        for method in TRIES
    }
    return pd.DataFrame(found, index=pd.Index(["p_expert", *TUNED], name="setting"))


def _tuned(preset: Preset, method: str, name: str) -> str:
    training, first = (
        preset.training_of(METHODS[method], "system1"),
        preset.pretraining_of(METHODS[method]),
    )
    both = [getattr(one, name) for one in (first, training) if one is not None]
    silent = (
        name in TUNED[-2:]
        and not training.regularise
        or name == TUNED[-3]
        and not METHODS[method].expert
    )
    return (
        "-"
        if silent
        else ", then ".join(dict.fromkeys(f"{value:,g}" for value in both))
    )


def _p_expert(preset: Preset, method: str) -> str:
    """The p_e of a method, a system after the other."""
    if not METHODS[method].expert:
        return "-"
    return ", ".join(
        f"{preset.training_of(METHODS[method], system).p_expert:g} ({system})"
        for system in SYSTEMS
    )
